"""The satellite receiver, and this computer's clock."""

import ctypes
import datetime
import json
import math
import socket
import struct
import time

from vehicle_checks.finding import fault, ok, unknown, warning

CONNECT_S, LISTEN_S = 3.0, 6.0
MOST_BYTES = 1 << 20
# Of adjtimex(2): the status word and its bit, in struct timex of 64 bits.
STATUS_OFFSET, UNSYNCHRONISED = 40, 0x40


class Gpsd:
    """What gpsd said. `problem`: why nothing was heard; `offset_s`: this clock before the receiver's."""

    def __init__(self):
        self.problem = None
        self.version = None
        self.devices = None
        self.mode = None
        self.offset_s = None
        self.error_m = None

    def take(self, line, device):
        """A line of gpsd's protocol; what is none is passed over."""
        try:
            word = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(word, dict):
            return
        kind = word.get("class")
        if kind == "VERSION":
            self.version = str(word.get("release"))
        elif kind == "DEVICES" and isinstance(word.get("devices"), list):
            paths = [str(entry.get("path")) for entry in word["devices"] if isinstance(entry, dict)]
            self.devices = [path for path in paths if device in ("", path)]
        elif kind == "TPV" and device in ("", word.get("device")):
            self.take_position(word)

    def take_position(self, word):
        mode = word.get("mode")
        if isinstance(mode, int):
            self.mode = max(self.mode or 0, mode)
        try:
            told = datetime.datetime.fromisoformat(str(word["time"]).replace("Z", "+00:00")).timestamp()
            self.offset_s = time.time() - told
        except (KeyError, ValueError, OverflowError):
            pass
        error = word.get("eph")
        if isinstance(error, (int, float)) and math.isfinite(error):
            self.error_m = error

    def is_enough(self):
        return self.devices == [] or (self.mode or 0) >= 2 and self.offset_s is not None


def ask_gpsd(values):
    """Listens until gpsd told a fix, or for LISTEN_S."""
    said = Gpsd()
    where = str(values.parameter("gps_receiver", "host", default="127.0.0.1")), values.port("gps_receiver", default=2947)
    device = str(values.parameter("gps_receiver", "device", default="") or "")
    try:
        with socket.create_connection(where, CONNECT_S) as connection:
            connection.sendall(b'?WATCH={"enable":true,"json":true};\n')
            listen(connection, said, device)
    except (OSError, UnicodeError) as error:
        if said.version is None:
            said.problem = f"no gpsd at {where[0]}:{where[1]}: {getattr(error, 'strerror', None) or error}"
    return said


def listen(connection, said, device):
    rest, total, end = b"", 0, time.monotonic() + LISTEN_S
    while total < MOST_BYTES and not said.is_enough() and (left := end - time.monotonic()) > 0:
        connection.settimeout(left)
        try:
            data = connection.recv(65536)
        except socket.timeout:
            break
        if not data:
            break
        total += len(data)
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            said.take(line, device)
    if said.version is None:
        said.problem = "what listens at gpsd's port says nothing, or nothing that gpsd says"


def receiver(values, live, gpsd):
    if values["receiver"] != "gpsd":
        return of_topic(values, live)
    said = gpsd.result()
    if said is None or said.problem:
        return fault(said.problem if said else "gpsd did not answer in time",
                     "sudo systemctl restart gpsd.socket gpsd; another place: gps_receiver:='{host: ..., port: ...}'")
    if not said.devices:
        return fault("gpsd runs and has no receiver" if said.devices == [] else "gpsd names no receivers",
                     "plug it in; name one that is no USB receiver in /etc/default/gpsd")
    name = ", ".join(said.devices[:3])
    if said.mode is None:
        return fault(f"{name} says nothing that gpsd understands", "check its cable, and the line's speed with gpsmon")
    if said.mode < 2:
        return fault(f"{name} has no fix", "wait below the open sky; a cold start takes minutes", mode=said.mode)
    error = f", error {said.error_m:.0f} m" if said.error_m is not None else ""
    return ok(f"{name} has a fix in {said.mode} dimensions{error}", mode=said.mode, error_m=said.error_m)


def of_topic(values, live):
    topic = "/" + values["fix"].strip("/")
    mend = "receiver:=gpsd for a USB receiver, or start the receiver's driver on this ROS master (fix:= names its topic)"
    heard = live.topic(topic)
    if isinstance(heard, str):
        return unknown(f"{topic}: {heard}", mend, rate_hz=None)
    if heard.last is None:
        return fault(f"nothing came on {topic} within {heard.seconds:.0f} s", mend, rate_hz=None)
    if not hasattr(heard.last, "position_covariance_type"):
        return fault(f"{topic} is of another type than sensor_msgs/NavSatFix", mend, rate_hz=None)
    rate = heard.rate_hz
    figures = {"rate_hz": None if rate is None else round(rate, 2)}
    if heard.last.status.status < 0:
        return fault(f"{topic} has no fix", "wait below the open sky; a cold start takes minutes", **figures)
    return ok(f"{topic} has a fix" + ("" if rate is None else f", {rate:.1f} a second"), **figures)


def kernel_is_synchronised():
    """Whether the kernel's clock is kept right, as timesyncd, chrony and ntpd tell it; None where it does not say."""
    buffer = ctypes.create_string_buffer(512)
    try:
        if ctypes.CDLL(None, use_errno=True).adjtimex(buffer) < 0:
            return None
    except AttributeError:
        return None
    return not struct.unpack_from("i", buffer, STATUS_OFFSET)[0] & UNSYNCHRONISED


def clock(values, gpsd):
    said = gpsd.result() if values["receiver"] == "gpsd" else None
    offset = said.offset_s if said and not said.problem else None
    figures = {"offset_s": None if offset is None else round(offset, 3)}
    mend = "install systemd-timesyncd or chrony and give the computer a network once; chrony can take gpsd's time"
    most = values.parameter("gps_receiver", "max_clock_offset_s", default=2.0)
    if offset is not None and isinstance(most, (int, float)) and abs(offset) > most:
        return fault(f"this clock is {abs(offset):.1f} s {'before' if offset > 0 else 'behind'} the receiver's, "
                     f"accepted are {most:g} s", mend, **figures)
    beside = "" if offset is None else f", {abs(offset):.1f} s from the receiver's"
    kept = kernel_is_synchronised()
    if kept:
        return ok(f"kept right by the network{beside}", **figures)
    if offset is not None:
        return ok(f"not kept by the network{beside}", **figures)
    if kept is None:
        return unknown("the kernel does not say whether its clock is kept right", mend, **figures)
    return warning("nobody keeps this clock right", mend, **figures)
