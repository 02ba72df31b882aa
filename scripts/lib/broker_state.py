"""What stands between a broker's folder and a running mosquitto: a torn state file, a port that is taken."""

import datetime
import os
import re
import shutil
import subprocess
import tempfile

from broker_files import Usage, find_program
from listening_port import why_not
from process_end import how_it_ended

STATE = "mosquitto.db"
# A restore that takes longer than this is one that works.
TRIAL_S = 60


def set_torn_state_aside(data):
    """Renames data/mosquitto.db where mosquitto cannot restore it, and returns a sentence about it; else None.

    A power loss can leave the file torn or zeroed, and mosquitto then never starts again. It holds sessions and queued
    messages, for which nobody relies on it: what has no receipt is sent again. mosquitto itself judges the file: it is
    tried on a link to it, without a port of its own.
    """
    path = os.path.join(data, STATE)
    if not os.path.lexists(path):
        return None
    try:
        fault = why_it_cannot_be_restored(path)
        if fault is None:
            return None
        kept = free_name(path)
        os.rename(path, kept)
    except OSError as error:
        raise Usage(f"'{path}' cannot be used ({error.strerror}); remove it, the broker does without") from error
    return (f"'{path}' cannot be restored ({fault}), so it was set aside as '{kept}' and the broker begins "
            "without it: vehicles send again what has no receipt")


def why_it_cannot_be_restored(path):
    if not os.path.isfile(path):
        return "it is no file"
    with open(path, "rb"):
        pass  # One that may not be read is not torn: the error says so.
    # Beside the file, so that a hard link reaches it; mosquitto is killed before it could write.
    with tempfile.TemporaryDirectory(prefix=".trial-", dir=os.path.dirname(path)) as trial:
        link_or_copy(path, os.path.join(trial, STATE))
        configuration = os.path.join(trial, "trial.conf")
        # Relative, because the path of a socket may have 107 bytes at most.
        lines = ["listener 0 trial.sock", "allow_anonymous false", "persistence true", "autosave_interval 0",
                 f"persistence_location {trial}/", "log_dest stderr", "log_type all"]
        if os.geteuid() == 0:
            lines.append("user root")
        with open(configuration, "w", encoding="utf-8", errors="surrogateescape") as file:
            file.write("\n".join(lines) + "\n")
        with open(os.path.join(trial, "log"), "w+b") as log, subprocess.Popen(
                [find_program("mosquitto"), "-c", configuration], cwd=trial, stdin=subprocess.DEVNULL, stdout=log,
                stderr=log) as process:
            try:
                return judge(process, log)
            finally:
                process.kill()


def link_or_copy(path, target):
    try:
        os.link(path, target)
    except OSError:
        shutil.copyfile(path, target)  # Not every file system has hard links.


def judge(process, log):
    """None once mosquitto runs; what it says about the file where it ends."""
    for _ in range(TRIAL_S * 50):
        try:
            code = process.wait(0.02)
        except subprocess.TimeoutExpired:
            log.seek(0)
            if re.search(rb"mosquitto version \S+ running", log.read()):
                return None
            continue
        log.seek(0)
        words = log.read().decode("utf-8", "replace")
        told = [re.sub(r"^\d+: Error: ", "", line).strip(" .") for line in words.splitlines() if "Error: " in line]
        # What is not about the file is for the real start to say.
        about_it = [line for line in told if "restor" in line.lower() or "persist" in line.lower() or "database" in line]
        if about_it:
            return f"mosquitto says: {about_it[0]}"
        return None if code > 0 and told else f"mosquitto {how_it_ended(code)} over it"
    return None


def free_name(path):
    """path.torn-TIME, with a number behind where two fall into one second."""
    name = f"{path}.torn-{datetime.datetime.now(datetime.timezone.utc):%Y%m%dT%H%M%SZ}"
    number = 2
    kept = name
    while os.path.lexists(kept):
        kept, number = f"{name}-{number}", number + 1
    return kept


def require_free_port(address, port):
    """Usage where mosquitto could not listen there; its own words name neither address nor port."""
    reason = why_not(address, port)
    if reason:
        raise Usage(reason)
