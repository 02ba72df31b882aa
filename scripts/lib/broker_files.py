"""What the broker with passwords and the one with certificates share: names, private files, rights, limits."""

import os
import re
import shutil
import sys

ZONE_USER = "zone"
# What may stand in an MQTT topic level, as a user name and as a file name; see docs/reference/wire.md.
ID_PATTERN = re.compile(r"[A-Za-z0-9._-]{1,64}")
# Envelope head and MQTT's own bytes around one message.
PACKET_OVERHEAD_BYTES = 4096
DEFAULT_MAX_MESSAGE_BYTES = 1 << 20


class Usage(Exception):
    """A wrong argument, told in one sentence."""


def require_id(text, what):
    if not ID_PATTERN.fullmatch(text) or text in (".", ".."):
        raise Usage(f"{what} {text!r} is not accepted, an id is 1 to 64 characters of "
                    "A-Z a-z 0-9 . _ -")
    return text


def require_vehicle(text):
    require_id(text, "vehicle")
    # Some brokers take A for a.
    if text.lower() == ZONE_USER:
        raise Usage(f"vehicle '{text}' is not accepted, it is the name of the zone's own login")
    return text


def require_listener(port, address, max_message_bytes):
    if not 1 <= port <= 65535:
        raise Usage(f"port {port} is not accepted, a port is 1 to 65535")
    if not re.fullmatch(r"[A-Za-z0-9.:-]+", address):
        raise Usage(f"address {address!r} is not accepted, an IP address or host name is")
    if not 1024 <= max_message_bytes <= 1 << 28:
        raise Usage(f"--max-message-bytes {max_message_bytes} is not accepted, "
                    "accepted are 1024 to 268435456")


def require_directory(text):
    """The full path of a folder that mosquitto.conf can name: what stands behind a setting's name, up to the line's end,
    is its value."""
    directory = os.path.abspath(text)
    if re.search(r"[\x00-\x1f\x7f]", directory):
        raise Usage(f"directory {directory!r} is not accepted, a path without control characters is")
    return directory


def find_program(name):
    """mosquitto lives in /usr/sbin, which is not on an ordinary user's PATH."""
    found = shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/usr/local/sbin")
    if found is None:
        raise Usage(f"program '{name}' is not installed, accepted is the Debian package mosquitto")
    return found


def write_private(path, content):
    """Replaces a file at once, readable by its owner alone; it is on disk, under its name, when this returns."""
    data = content.encode("utf-8", "surrogateescape") if isinstance(content, str) else content
    temporary = path + ".new"
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)
    sync_folder(os.path.dirname(path))


def sync_folder(path):
    """Without it a power loss can take back the names of files that are on disk."""
    descriptor = os.open(path or ".", os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def vehicle_rights(zone):
    """%u is the name that the broker authenticated: a vehicle reaches its own topics alone."""
    vehicle = f"livemap/v1/{zone}/vehicle/%u"
    return [f"pattern write {vehicle}/report",
            f"pattern write {vehicle}/position",
            f"pattern write {vehicle}/answer",
            f"pattern write {vehicle}/candidate",
            f"pattern write {vehicle}/change",
            f"pattern read {vehicle}/receipt",
            f"pattern read {vehicle}/change_receipt",
            f"pattern read {vehicle}/notice",
            f"pattern write {vehicle}/cell_request",
            f"pattern read {vehicle}/cell_hazards",
            f"pattern read {vehicle}/poll",
            f"pattern read {vehicle}/directory"]


def limits(max_message_bytes):
    return [
        "# Limits per message and per client.",
        f"message_size_limit {max_message_bytes}",
        f"max_packet_size {max_message_bytes + PACKET_OVERHEAD_BYTES}",
        "max_inflight_messages 1000",
        "max_queued_messages 10000",
        "max_queued_bytes 268435456",
        "max_keepalive 300",
        "# Nothing in this system is retained: a vehicle cannot leave messages behind.",
        "retain_available false",
    ]


def log_and_user():
    lines = ["log_dest stderr", "log_type error", "log_type warning", "log_type notice"]
    if os.geteuid() == 0:
        lines += ["# Started by root: mosquitto would otherwise become a user who cannot read",
                  "# these files.", "user root"]
    return lines
