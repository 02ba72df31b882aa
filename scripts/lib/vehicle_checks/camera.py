"""The camera: the pictures it gives, its calibration and its mounting."""

import fcntl
import json
import math
import os
import re
import stat
import struct
import subprocess
import sys
import urllib.parse

from vehicle_checks.finding import Unreadable, fault, ok, read_file, read_yaml, unknown, warning

LOOK_S, LOOK_PATIENCE_S = 2.0, 8.0
DISTORTIONS = ("", "plumb_bob", "rational_polynomial", "equidistant", "fisheye")
# Of V4L2: VIDIOC_QUERYCAP and the bits of what it answers.
QUERY_CAPABILITIES, CAPABILITIES = 0x80685600, struct.Struct("16s32s32sIII12x")
CAPTURES, STREAMS = 0x1, 0x04000000
# Reads what OpenCV reads, as camera_ingest does; apart, as a driver may keep its reader waiting.
LOOK = """
import json, sys, time
import cv2
path, width, height, patience_s = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4])
device = path.startswith("/dev/")
capture = cv2.VideoCapture(path, cv2.CAP_V4L2) if device else cv2.VideoCapture(path)
if device and width:
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
count, size, first, last = 0, None, None, None
begin = time.monotonic()
while time.monotonic() - begin < patience_s:
    got, image = capture.read()
    if not got:
        break
    last = time.monotonic()
    first = first or last
    count, size = count + 1, [image.shape[1], image.shape[0]]
    if not device:
        break
rate = (count - 1) / (last - first) if count > 1 and last > first else None
print(json.dumps({"opened": capture.isOpened(), "count": count, "size": size, "rate_hz": rate}), flush=True)
"""


def picture(values, live, vehicle_runs):
    source = values.parameter("camera_ingest", "source", "input")
    path = str(values.parameter("camera_ingest", "uri", "path"))
    if source == "topic":
        return of_topic(values, live)
    if source not in ("device", "video", "folder"):
        return fault(f"input is '{source}'", "input:= topic, device, video or folder")
    if not path:
        return fault(f"input:={source} has no path", "path:=/dev/video0, or that of the video file or folder")
    if source == "folder":
        return of_folder(path)
    return of_device(values, path, vehicle_runs) if source == "device" else of_reader(values, path, path)


def of_topic(values, live):
    topic = "/" + values["image"].strip("/") + ("" if values["transport"] == "raw" else "/compressed")
    mend = "start the camera's driver on this ROS master, or input:=device path:=/dev/video0"
    heard = live.topic(topic)
    if isinstance(heard, str):
        return unknown(f"{topic}: {heard}", mend, rate_hz=None)
    if heard.count == 0:
        return fault(f"nothing came on {topic} within {heard.seconds:.0f} s", mend + "; rostopic list shows what there is",
                     rate_hz=None)
    rate = heard.rate_hz
    if rate is None:
        return warning(f"one picture on {topic} within {heard.seconds:.0f} s", "see why the driver is slow", rate_hz=None)
    return ok(f"{topic}, {rate:.1f} pictures a second", rate_hz=round(rate, 2))


def of_folder(path):
    try:
        count = sum(entry.name.lower().endswith((".jpg", ".jpeg", ".png")) for entry in os.scandir(path))
    except OSError as error:
        return fault(f"'{path}' cannot be read: {error.strerror}", "path:= a folder of .jpg and .png files")
    if count == 0:
        return fault(f"'{path}' has no .jpg or .png file", "path:= a folder of pictures")
    return ok(f"folder '{path}', {count} pictures", pictures=count)


def of_device(values, path, vehicle_runs):
    """Opens it as camera_ingest does. A vehicle that runs has its pictures already."""
    try:
        status = os.stat(path)
    except OSError as error:
        return fault(f"the camera device '{path}': {error.strerror}",
                     "plug the camera in; ls /dev/video* lists those there are", rate_hz=None)
    if not stat.S_ISCHR(status.st_mode):
        return fault(f"'{path}' is no camera device", "path:= a device like /dev/video0", rate_hz=None)
    try:
        handle = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        return fault(f"'{path}' cannot be opened: {error.strerror}",
                     "the user must be in the group video: sudo usermod -aG video $USER, then log in again", rate_hz=None)
    try:
        answer = fcntl.ioctl(handle, QUERY_CAPABILITIES, bytes(CAPABILITIES.size))
        _, card, _, _, all_of_it, own = CAPABILITIES.unpack(answer)
    except OSError as error:
        return fault(f"'{path}' is no camera: {error.strerror}", "path:= another of ls /dev/video*", rate_hz=None)
    finally:
        os.close(handle)
    name = f"'{path}' ({card.rstrip(bytes(1)).decode('utf-8', 'replace')})"
    if not (own or all_of_it) & CAPTURES or not (own or all_of_it) & STREAMS:
        return fault(f"{name} gives no pictures", "a camera has several devices, take the first: /dev/video0", rate_hz=None)
    if vehicle_runs:
        return ok(f"{name} is there; its pictures go to the running vehicle", rate_hz=None)
    return of_reader(values, path, name)


def of_reader(values, path, name):
    width, height = calibrated_size(values)
    try:
        done = subprocess.run([sys.executable, "-c", LOOK, path, str(width), str(height), str(LOOK_S)], capture_output=True,
                              text=True, errors="replace", timeout=LOOK_PATIENCE_S, check=False, stdin=subprocess.DEVNULL)
    except subprocess.TimeoutExpired:
        return fault(f"{name} opens and gives no picture within {LOOK_PATIENCE_S:.0f} s",
                     "unplug the camera and plug it in again, and see dmesg", rate_hz=None)
    if "No module named 'cv2'" in done.stderr:
        return unknown(f"{name} is there; its pictures are not looked at without Python's OpenCV",
                       "sudo apt-get install python3-opencv", rate_hz=None)
    try:
        seen = json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        return fault(f"{name}: its reader ended with code {done.returncode}", "see dmesg, or take another camera", rate_hz=None)
    if not seen["opened"] or not seen["count"]:
        return fault(f"{name} {'gives no picture' if seen['opened'] else 'cannot be opened: in use, or no pictures'}",
                     "end what else uses it (fuser -v shows it), or give another path:=", rate_hz=None)
    size = tuple(seen["size"])
    figures = {"width": size[0], "height": size[1], "rate_hz": seen["rate_hz"] and round(seen["rate_hz"], 2)}
    found = f"{name}, {size[0]}x{size[1]}" + (f", {seen['rate_hz']:.1f} pictures a second" if seen["rate_hz"] else "")
    if width and size != (width, height):
        return fault(f"{found}; the calibration is for {width}x{height}", "calibrate at the size that the camera gives",
                     **figures)
    if seen["rate_hz"] and seen["rate_hz"] < 2:
        return warning(found, "more light, or a smaller picture: below 2 a second hazards are missed", **figures)
    return ok(found, **figures)


class Implausible(Exception):
    """What of a calibration cannot be."""


def numbers_of(content, name, count=None):
    """The numbers of a matrix, as ROS reads them: it wants rows, cols and data. `count`: how many are accepted."""
    try:
        matrix = content[name]
        wanted = matrix["rows"] * matrix["cols"]
        found = [float(number) for number in matrix["data"]]
    except (KeyError, TypeError, ValueError):
        raise Implausible(f"{name} has no rows, cols and data of numbers") from None
    if len(found) != wanted or count not in (None, wanted) or not all(map(math.isfinite, found)):
        raise Implausible(f"{name} does not hold {count or wanted} numbers")
    return found


def calibration_file(values):
    """The path of the file, or Unreadable."""
    url = str(values.parameter("camera_ingest", "camera_info_url", "camera_info_url"))
    if not url:
        raise Unreadable("no calibration is given")
    parts = urllib.parse.urlsplit(url)
    if parts.scheme != "file" or not parts.path.startswith("/") or parts.netloc:
        raise Unreadable(f"camera_info_url is '{url}', accepted is file:// and an absolute path: three slashes")
    return parts.path


def calibrated_size(values):
    """(0, 0) where it is not known."""
    try:
        content = read_yaml(calibration_file(values))
        return int(content["image_width"]), int(content["image_height"])
    except (Unreadable, KeyError, TypeError, ValueError, OverflowError):
        return 0, 0


def calibration(values, live):
    mend = "calibrate it (docs/how-to/mount-a-camera.md) and give camera_info_url:=file:///PATH"
    if values.parameter("camera_ingest", "source", "input") == "topic":
        topic = "/" + values["camera_info"].strip("/")
        heard = live.topic(topic)
        mend = f"have the camera's driver publish {topic}, or name its topic by camera_info:="
        if isinstance(heard, str):
            return unknown(f"{topic}: {heard}", mend)
        if heard.last is None:
            return fault(f"nothing came on {topic} within {heard.seconds:.0f} s", mend)
        info = heard.last
        if not hasattr(info, "distortion_model"):
            return fault(f"{topic} is of another type than sensor_msgs/CameraInfo", mend)
        return judged(topic, info.width, info.height, list(info.K), info.distortion_model, mend)
    try:
        path = calibration_file(values)
        content = read_yaml(path)
    except Unreadable as reason:
        return fault(str(reason), mend)
    try:
        size = [content.get("image_width"), content.get("image_height")]
        if not all(isinstance(side, int) and not isinstance(side, bool) for side in size):
            raise Implausible("image_width and image_height are no whole numbers")
        matrix = numbers_of(content, "camera_matrix", 9)
        numbers_of(content, "rectification_matrix", 9)
        numbers_of(content, "projection_matrix", 12)
        numbers_of(content, "distortion_coefficients")
    except Implausible as reason:
        return fault(f"'{path}': {reason}", mend)
    return judged(f"'{path}'", *size, matrix, str(content.get("distortion_model") or ""), mend)


def judged(name, width, height, matrix, distortion, mend):
    if not (16 <= width <= 16384 and 16 <= height <= 16384):
        return fault(f"{name} is for pictures of {width}x{height}, accepted are 16 to 16384", mend)
    fx, fy, cx, cy = matrix[0], matrix[4], matrix[2], matrix[5]
    if not fx > 0 or not fy > 0:
        return fault(f"{name} has a focal length of {fx:g} and {fy:g} pixels, accepted are numbers above 0", mend)
    if distortion not in DISTORTIONS:
        return fault(f"{name} has the distortion model '{distortion}', accepted are {', '.join(DISTORTIONS[1:])}", mend)
    view = math.degrees(2 * math.atan(width / 2 / fx))
    found = f"{name}, {width}x{height}, focal length {fx:.0f} pixels, {view:.0f} degrees wide"
    figures = {"width": width, "height": height, "fx": round(fx, 2), "fy": round(fy, 2)}
    if not 15 <= view <= 150:
        return fault(f"{found}: no camera for a road", mend, **figures)
    if not 0.8 <= fx / fy <= 1.25 or not 0.25 < cx / width < 0.75 or not 0.25 < cy / height < 0.75:
        return warning(f"{found}; its pixels are not square, or its middle lies far aside", mend, **figures)
    return ok(found, **figures)


def mounting(values):
    """The arguments of where the camera is, and what earlier drives found out."""
    if not values.is_true("publish_mounting"):
        return unknown("tf has the camera's mounting (publish_mounting:=false), which is not looked at here")
    x, y, z, pitch = (values.number(name) for name in ("camera_x", "camera_y", "camera_z", "camera_pitch"))
    mend = "measure it (docs/how-to/mount-a-camera.md): camera_x, camera_y, camera_z in metres, camera_pitch in radians"
    for name, value, least, most in (("camera_x", x, -20, 20), ("camera_y", y, -3, 3), ("camera_z", z, 0.2, 5),
                                     ("camera_pitch", pitch, -0.8, 0.8)):
        if value is None or not least <= value <= most:
            hint = "; is it in degrees?" if name == "camera_pitch" and value is not None and math.isfinite(value) else ""
            return fault(f"{name} is '{values[name]}', plausible is {least} to {most}{hint}", mend)
    figures = {"height_m": z, "pitch_deg": round(math.degrees(pitch), 2)}
    found = f"{x:g} m ahead, {y:g} m left, {z:g} m above the road, {math.degrees(pitch):.1f} degrees down"
    if not values.is_true("vo_runs"):
        return ok(found, **figures)
    return with_store(values, found, figures, mend)


def with_store(values, found, figures, mend):
    path = os.path.join(values["directory"], "mounting.yaml")
    if not os.path.lexists(path):
        return ok(f"{found}; the first drives find the rest", **figures)
    try:
        lines = read_file(path, 65536).decode("utf-8", "replace").splitlines()
    except Unreadable as reason:
        return warning(f"{found}; {reason}", "remove the file: the next drive finds the mounting anew", **figures)
    kept = dict(re.findall(r"^ *(\w+) *: *(\S+) *$", "\n".join(lines), re.M))
    try:
        kept_pitch, kept_sigma = float(kept["pitch_deg"]), float(kept["pitch_sigma_deg"])
        if kept.get("end") != "true" or not math.isfinite(kept_pitch) or not math.isfinite(kept_sigma):
            raise ValueError
    except (KeyError, ValueError):
        return warning(f"{found}; '{path}' is damaged", "nothing: edge_vo sets it aside and finds the mounting anew", **figures)
    figures["kept_pitch_deg"] = kept_pitch
    found += f"; earlier drives found {kept_pitch:.1f} degrees down"
    if abs(kept_pitch - figures["pitch_deg"]) > max(3.0, 5 * kept_sigma):
        return warning(found, f"{mend}; where it was moved, remove '{path}'", **figures)
    return ok(found, **figures)
