"""How a program ended, in words."""

import signal


def name_of_signal(number):
    try:
        return f"signal {number} ({signal.Signals(number).name})"
    except ValueError:
        return f"signal {number}"


def how_it_ended(code):
    """"ended with code 3" or "was ended by signal 9 (SIGKILL)", from what subprocess and roslaunch call a return code:
    a negative one is a signal. A shell between tells a signal as 128 more than its number."""
    if code is None:
        return "ended, and nobody saw how"
    if code < 0:
        return f"was ended by {name_of_signal(-code)}"
    if 128 < code < 128 + signal.NSIG:
        return f"ended with code {code}, as a shell calls {name_of_signal(code - 128)}"
    return f"ended with code {code}"
