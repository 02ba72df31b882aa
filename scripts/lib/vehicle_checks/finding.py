"""What a check found, and the reading of files that may be anything."""

import dataclasses
import os
import stat
import unicodedata

OK, WARNING, FAULT, UNKNOWN = "ok", "warning", "fault", "unknown"
MOST_CHARACTERS = 240
MOST_BYTES = 1 << 20


def clean(text):
    """Text of a device, a file or a peer, without what moves a terminal's cursor or turns its lines around."""
    kept = "".join(" " if unicodedata.category(c)[0] == "C" or unicodedata.category(c) in ("Zl", "Zp") else c
                   for c in str(text)[:4 * MOST_CHARACTERS])
    kept = " ".join(kept.split())
    return kept if len(kept) <= MOST_CHARACTERS else kept[:MOST_CHARACTERS - 3] + "..."


@dataclasses.dataclass(frozen=True)
class Finding:
    """`found` is what is there; of an unknown thing, why it is unknown. `values`: numbers, None where not measured."""
    status: str
    found: str
    mend: str = ""
    values: dict = dataclasses.field(default_factory=dict)


def ok(found, **values):
    return Finding(OK, found, "", values)


def warning(found, mend, **values):
    return Finding(WARNING, found, mend, values)


def fault(found, mend, **values):
    return Finding(FAULT, found, mend, values)


def unknown(reason, mend="", **values):
    return Finding(UNKNOWN, reason, mend, values)


class Unreadable(Exception):
    """Why a file cannot be read, in words."""


def read_file(path, most=MOST_BYTES):
    """The bytes of an ordinary file; Unreadable of any other: a pipe would keep its reader waiting for ever."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        raise Unreadable(f"'{path}' cannot be read: {getattr(error, 'strerror', None) or error}") from None
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise Unreadable(f"'{path}' is no ordinary file")
        if status.st_size > most:
            raise Unreadable(f"'{path}' has {status.st_size} bytes, accepted are {most}")
        try:
            return file.read(most)
        except OSError as error:
            raise Unreadable(f"'{path}' cannot be read: {error.strerror}") from None


def read_yaml(path):
    """The mapping in a YAML file; Unreadable where it holds anything else."""
    data = read_file(path)
    try:
        import yaml
    except ImportError:
        raise Unreadable("Python's yaml is not installed: ./livemap setup installs it") from None
    try:
        value = yaml.safe_load(data)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        raise Unreadable(f"'{path}' is no YAML" + (f", line {line + 1}" if line is not None else "")) from None
    if not isinstance(value, dict):
        raise Unreadable(f"'{path}' is no YAML of keys and values")
    return value
