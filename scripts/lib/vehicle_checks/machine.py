"""This computer: the model, how fast it detects here, the disk."""

import hashlib
import json
import os
import pathlib
import queue
import shutil
import stat
import struct
import subprocess
import tempfile
import threading
import time
import zlib

from vehicle_checks.camera import calibrated_size
from vehicle_checks.finding import Unreadable, fault, ok, read_yaml, unknown, warning

MEASURE_S, START_S = 4.0, 12.0
SLOW_HZ = 2.0
MOST_PICTURES = 400
FULL_MB, NEARLY_FULL_MB = 200, 2000
MOST_WEIGHTS_BYTES = 1 << 30


def manifest_of(values):
    """The manifest that would run, and its launch argument; None where nothing runs on board."""
    if values.is_true("detect"):
        return str(values.parameter("hazard_detection", "model", "model")), "model"
    if values["profile"] == "small":
        return str(values.parameter("early_discard", "model", "discard_model")), "discard_model"
    return None


def model(values):
    manifest = manifest_of(values)
    if not manifest:
        return ok("no detector on board (detect:=false)")
    path, argument = manifest
    mend = f"{argument}:= a manifest of models/, with the files it names beside it; git checkout models restores them"
    try:
        content = read_yaml(path)
    except Unreadable as reason:
        return fault(str(reason), mend)
    pairs = [(content.get(key), content.get(digest)) for key, digest in
             (("file", "sha256"), ("torch_file", "torch_sha256"), ("int8_file", "int8_sha256")) if key in content]
    if not pairs:
        return fault(f"'{path}' names no file of weights", mend)
    for name, wanted in pairs:
        try:
            got = digest_of(os.path.join(os.path.dirname(path), str(name)))
        except Unreadable as reason:
            return fault(str(reason), mend)
        if got != str(wanted).lower():
            return fault(f"'{name}' has the SHA-256 {got[:12]}..., and the manifest states {str(wanted)[:12]}...", mend)
    return ok(f"{content.get('name')}, {len(pairs)} {'file' if len(pairs) == 1 else 'files'} of weights as the manifest states")


def digest_of(path):
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        raise Unreadable(f"'{path}' cannot be read: {getattr(error, 'strerror', None) or error}") from None
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode) or status.st_size > MOST_WEIGHTS_BYTES:
            raise Unreadable(f"'{path}' is no file of weights")
        digest = hashlib.sha256()
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def png(width, height):
    """A grey picture with some texture."""
    rows = b"".join(b"\0" + bytes((row * 7 + (column >> 3) * 5) & 0xFF for column in range(width)) for row in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))


def frames_per_second(values, programs, vehicle_runs):
    """Runs the detector itself for some seconds, with the model that would be driven with."""
    nothing = {"frames_per_second": None}
    if vehicle_runs:
        return unknown("not measured beside a running vehicle, which it would slow down", **nothing)
    if not values.is_true("detect"):
        return unknown("no detector runs on board, so none is measured", **nothing)
    program = programs / "livemap_detect_image"
    if not os.access(program, os.X_OK):
        return unknown("the program that measures it is not built", "./livemap setup --dev builds it", **nothing)
    width, height = calibrated_size(values)
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        width, height = 640, 400
    with tempfile.TemporaryDirectory(prefix="livemap_check_") as folder:
        picture = pathlib.Path(folder) / "picture.png"
        picture.write_bytes(png(width, height))
        times, words = run_detector(program, manifest_of(values)[0], picture)
    if len(times) < 2 or times[-1] <= times[0]:
        return unknown(f"the detector gave no two pictures in {START_S:.0f} s" + (f": {words}" if words else ""),
                       "see the model above", **nothing)
    rate = (len(times) - 1) / (times[-1] - times[0])
    found = f"{rate:.1f} pictures of {width}x{height} a second, {len(times) - 1} measured"
    if os.getloadavg()[0] > 1.5 * (os.cpu_count() or 1):
        found += ", while other programs kept this computer busy"
    figures = {"frames_per_second": round(rate, 2), "pictures": len(times) - 1}
    if rate < SLOW_HZ:
        return warning(found, "model:=$PWD/models/hazards-small.yaml, or profile:=small (docs/how-to/choose-a-detector.md)", **figures)
    return ok(found, **figures)


def run_detector(program, manifest, picture):
    """When each picture was done, and the last words where the program failed."""
    command = [str(program), "--model", manifest, *[str(picture)] * MOST_PICTURES]
    if shutil.which("stdbuf"):
        command = ["stdbuf", "-oL", *command]
    lines = queue.Queue()
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors)

        def read():
            for line in process.stdout:
                lines.put((time.monotonic(), line))
            lines.put(None)

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        times = collect(lines)
        process.kill()
        process.wait()
        errors.seek(0)
        return times, errors.read(2000).decode("utf-8", "replace").strip()


def collect(lines):
    """Until MEASURE_S after the first picture; it waits START_S for that one, as weights are read first."""
    times, end = [], time.monotonic() + START_S
    while (left := end - time.monotonic()) > 0:
        try:
            entry = lines.get(timeout=left)
        except queue.Empty:
            break
        if entry is None:
            break
        try:
            json.loads(entry[1])
        except ValueError:
            continue
        if not times:
            end = entry[0] + MEASURE_S
        times.append(entry[0])
    return times


def disk(values):
    folder = os.path.abspath(values["directory"])
    there = folder
    while not os.path.lexists(there) and there != "/":
        there = os.path.dirname(there)
    if not os.path.isdir(there):
        return fault(f"'{there}' is no folder", "directory:= a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        return fault(f"this user may not write into '{there}'", f"sudo chown $USER {there}, or directory:= another folder")
    status = os.statvfs(there)
    free_mb = status.f_bavail * status.f_frsize // 1_000_000
    found = f"{free_mb / 1000:.1f} GB free in '{folder}'" + ("" if there == folder else ", which is made at the start")
    mend = f"remove what is not needed, or directory:= a folder on another disk; df -h {there}"
    if free_mb < FULL_MB:
        return fault(found, mend, free_mb=free_mb)
    if free_mb < NEARLY_FULL_MB:
        return warning(found, mend, free_mb=free_mb)
    return ok(found, free_mb=free_mb)
