"""What stands beside every figure: the processor and the commit it was measured on."""

import os
import subprocess


def processor():
    """The processor's name as the system tells it; "unknown processor" where it does not."""
    with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
        models = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    return models[0] if models else "unknown processor"


def cores():
    return os.cpu_count()


def version(folder):
    """The commit that is checked out there, with "-dirty" for changes on top of it; empty outside a checkout."""
    done = subprocess.run(["git", "describe", "--always", "--dirty"], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True, check=False, cwd=folder)
    return done.stdout.strip()
