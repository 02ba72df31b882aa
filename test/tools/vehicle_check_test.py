#!/usr/bin/python3
"""livemap vehicle check against real parts: mosquitto with a zone's certificates, gpsd with a receiver, files, and peers
that are dead."""

import concurrent.futures
import contextlib
import datetime
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import xmlrpc.client

from cryptography.hazmat.primitives import serialization
from cryptography.x509.oid import ExtendedKeyUsageOID

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test/zone_identity"))
from zone_fixture import Zone  # noqa: E402
from certificate_authority import Authority, certificate_pem  # noqa: E402
from listening_port import free_port  # noqa: E402

sys.path.insert(0, str(ROOT / "scripts/lib"))
from vehicle_checks.finding import clean  # noqa: E402

try:
    import gps.fake as gps_fake
except ImportError:
    gps_fake = None
WORKERS = 8
GPSD = shutil.which("gpsd", path=os.environ.get("PATH", "") + ":/usr/sbin")

CALIBRATION = """\
image_width: {width}
image_height: 400
camera_matrix: {{rows: 3, cols: 3, data: [{focal}, 0, 319.5, 0, {focal}, 199.5, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix: {{rows: 3, cols: 4, data: [{focal}, 0, 319.5, 0, 0, {focal}, 199.5, 0, 0, 0, 1, 0]}}
"""
# Says what the detector says, ten times a second.
DETECTOR = """#!/bin/sh
while :; do echo '{"image":"picture.png","detections":[]}'; sleep 0.1; done
"""

# A vehicle's manager by its name, with what its nodes say on /diagnostics, and the drivers' topics.
VEHICLE = """
import json, sys, time
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import CameraInfo, CompressedImage, NavSatFix
rospy.init_node("vehicle_manager" if sys.argv[1] == "vehicle" else "driver", disable_signals=True)
lines = json.loads(sys.argv[2])
image = rospy.Publisher("/camera/image_raw/compressed", CompressedImage, queue_size=10)
info = rospy.Publisher("/camera/camera_info", CameraInfo, queue_size=10)
fix = rospy.Publisher("/fix", NavSatFix, queue_size=10)
diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
turn = 0
while True:
    turn += 1
    image.publish(CompressedImage(data=b"picture"))
    info.publish(CameraInfo(width=640, height=400, distortion_model="plumb_bob", K=[520, 0, 320, 0, 520, 200, 0, 0, 1]))
    fix.publish(NavSatFix())
    diagnostics.publish(DiagnosticArray(status=[DiagnosticStatus(
        hardware_id=name, level=level, message=message,
        values=[KeyValue(key, str(turn if value == "rises" else value)) for key, value in values.items()])
        for name, (level, message, values) in lines.items()]))
    time.sleep(0.1)
"""
WELL = {"camera_ingest": (0, "running", {"rate_hz": 9.5, "frames_dropped": 3}),
        "hazard_detection": (0, "running", {"rate_hz": 9.0, "detection_ms": 50, "frames_dropped": 0, "model": "m"}),
        "edge_vo": (0, "tracking", {"mounting": "found", "mounting_pitch_deg": 2.0, "mounting_knocks": 0, "mounting_problem": ""}),
        "mqtt_bridge": (0, "connected", {"connected": "True", "broker": "b:1", "user": "car-1", "publishes_refused": 0}),
        "hazard_reporting": (0, "running", {"pending": 0})}
# Where these nodes say that something is wrong.
UNWELL = {"camera_ingest": (1, "behind: dropping frames", {"rate_hz": 9.5, "frames_dropped": "rises"}),
          "edge_vo": (1, "tracking", {"mounting": "found", "mounting_pitch_deg": "nan", "mounting_knocks": 1}),
          "mqtt_bridge": (1, "refused \x1b[2J", {"connected": "False", "broker": "b:1"}),
          "hazard_reporting": (0, "running", {"pending": 101})}


def sentence(text):
    checksum = 0
    for character in text:
        checksum ^= ord(character)
    return f"${text}*{checksum:02X}\r\n".encode()


def receiver_says(seconds, valid):
    clock = time.strftime("%H%M%S", time.gmtime(seconds)) + f".{int(100 * (seconds % 1)):02d}"
    date = time.strftime("%d%m%y", time.gmtime(seconds))
    if not valid:
        return [sentence(f"GPRMC,{clock},V,,,,,,,{date},,,N"), sentence("GPGSA,A,1,,,,,,,,,,,,,99.9,99.9,99.9")]
    place = "2736.0000000,S,04830.0000000,W"
    return [sentence(f"GPRMC,{clock},A,{place},10.0,45.0,{date},,,A"),
            sentence(f"GPGGA,{clock},{place},1,08,0.9,12.0,M,3.0,M,,"),
            sentence("GPGSA,A,3,01,02,03,04,05,06,07,08,,,,,1.8,0.9,1.5")]


class SatelliteReceiver:
    """A real gpsd with gpsfake's pseudo-terminal; `ahead_s`: how far the receiver's clock is ahead."""

    class Load:
        name, serial, delay, sentences = "receiver", None, 0, ()

    def __init__(self, valid=True, ahead_s=0.0, plugged=True):
        self.port = free_port()
        self.folder = tempfile.TemporaryDirectory(prefix="livemap_gpsd_")
        control = os.path.join(self.folder.name, "control")
        environment = dict(os.environ, GPSD_SHM_KEY=f"0x4771{self.port:04X}")
        self.gpsd = subprocess.Popen([GPSD, "-n", "-b", "-N", "-S", str(self.port), "-F", control], env=environment,
                                     stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 30
        while not os.path.exists(control):
            assert time.monotonic() < deadline, "gpsd does not start"
            time.sleep(0.05)
        self.speaks, self.valid, self.ahead_s = True, valid, ahead_s
        self.thread = threading.Thread(target=self.run, daemon=True)
        if plugged:
            self.pty = gps_fake.FakePTY(self.Load, speed=9600)
            os.set_blocking(self.pty.fd, False)
            self.thread.start()
            gps_fake.DaemonInstance(control).add_device(self.pty.byname)

    def run(self):
        while self.speaks:
            for line in receiver_says(time.time() + self.ahead_s, self.valid):
                with contextlib.suppress(BlockingIOError):
                    self.pty.write(line)
            time.sleep(0.25)

    def close(self):
        self.speaks = False
        self.gpsd.kill()
        self.gpsd.wait()
        self.folder.cleanup()


class SilentPeer:
    """Accepts connections, says `words` to each, and nothing else."""

    def __init__(self, words=b""):
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.words = words
        self.kept = []
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        with contextlib.suppress(OSError):
            while True:
                self.kept.append(self.socket.accept()[0])
                self.kept[-1].sendall(self.words)

    def close(self):
        for connection in (*self.kept, self.socket):
            connection.close()


class VehicleCheckTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_check_test_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.pictures = self.folder / "pictures"
        self.pictures.mkdir()
        (self.pictures / "1.jpg").write_bytes(b"picture")
        self.calibrate()
        self.programs = self.folder / "programs"
        self.programs.mkdir()
        # Nobody is there, as before a drive.
        self.master = f"http://127.0.0.1:{free_port()}"

    def calibrate(self, focal=520, width=640):
        (self.folder / "camera.yaml").write_text(CALIBRATION.format(focal=focal, width=width))

    def install(self, program):
        path = self.programs / "livemap_detect_image"
        path.write_text(program)
        path.chmod(0o755)

    def zone(self):
        zone = Zone()
        self.addCleanup(zone.close)
        return zone

    def run_check(self, *arguments):
        return subprocess.run([sys.executable, str(ROOT / "scripts/livemap_vehicle_check"), "--root", str(ROOT),
                               "--programs", str(self.programs), *arguments], capture_output=True, text=True, timeout=60,
                              env=dict(os.environ, ROS_MASTER_URI=self.master), stdin=subprocess.DEVNULL)

    def check(self, *launch, code=None):
        """Of each check its entry; `self.ok` is the whole."""
        given = {argument.partition(":=")[0] for argument in launch}
        usual = {"input": "folder", "path": str(self.pictures), "camera_info_url": f"file://{self.folder}/camera.yaml",
                 "directory": str(self.folder / "remembered")}
        begin = time.monotonic()
        done = self.run_check("--json", *launch, *(f"{name}:={value}" for name, value in usual.items() if name not in given))
        self.assertLess(time.monotonic() - begin, 30, "it ends in seconds")
        self.assertIn(done.returncode, (0, 1), done.stderr)
        said = json.loads(done.stdout)
        self.assertEqual(said["ok"], done.returncode == 0)
        if code is not None:
            self.assertEqual(done.returncode, code, done.stdout)
        for entry in said["checks"]:
            self.assertEqual(entry["found"] is None, entry["status"] == "unknown", entry)
            self.assertEqual(entry["reason"] is None, entry["status"] != "unknown", entry)
        return {entry["name"]: entry for entry in said["checks"]}

    def assert_check(self, entry, status, *words):
        self.assertEqual(entry["status"], status, entry)
        for word in words:
            self.assertIn(word, entry["found"] or entry["reason"])
        if status == "fault":
            self.assertTrue(entry["mend"], "it says how to mend it")

    def by_identity(self, zone, name, folder=None):
        return (f"identity:={folder or zone.identity(name)}", f"broker_port:={zone.port}", f"vehicle:={name}", "zone:=test")

    @unittest.skipUnless(GPSD and gps_fake, "no gpsd or gpsfake")
    def test_a_vehicle_that_is_ready_ends_with_0_and_each_fault_with_1(self):
        self.install(DETECTOR)
        zone = self.zone()
        zone.enroll("car-1")
        zone.start()
        satellites = SatelliteReceiver()
        self.addCleanup(satellites.close)
        ready = (*self.by_identity(zone, "car-1"), "receiver:=gpsd", f"gps_receiver:={{port: {satellites.port}}}")
        found = self.check(*ready, code=0)
        for name in ("picture", "calibration", "mounting", "receiver", "clock", "model", "frames per second", "broker",
                     "identity"):
            self.assertEqual(found[name]["status"], "ok", found[name])
        self.assertIn(found["disk"]["status"], ("ok", "warning"))
        self.assertLess(abs(found["clock"]["values"]["offset_s"]), 2)
        self.assertGreater(found["frames per second"]["values"]["frames_per_second"], 3)
        shown = self.run_check(*ready)  # Without a camera's topic.
        self.assertEqual(shown.returncode, 1)
        self.assertIn("not ready to drive: picture, calibration\n", shown.stdout)
        self.assertLessEqual(max(map(len, shown.stdout.splitlines())), 400)
        for wrong in (f"path:={self.folder}/nothing", "camera_pitch:=5", "model:=/nothing.yaml", f"directory:={__file__}/x"):
            self.check(*ready, wrong, code=1)

    def test_a_wrong_command_line_ends_with_2_and_one_sentence(self):
        for wrong in ("camera:=front", "front", "--nothing", "vehicle:=car\n1", "mqtt_bridge:=[", "broker_port:=many",
                      "gps_receiver_config:=/nothing.yaml"):
            done = self.run_check(wrong, "receiver:=gpsd")
            self.assertEqual((done.returncode, done.stdout), (2, ""), f"{wrong}: {done.stderr}")
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)

    def test_without_a_ros_master_what_only_a_topic_tells_is_unknown(self):
        found = self.check("input:=topic", code=1)
        for name in ("picture", "calibration", "receiver"):
            self.assert_check(found[name], "unknown", "no ROS master runs")
        self.assertIsNone(found["picture"]["values"]["rate_hz"])

    def test_a_ros_master_that_says_nothing_costs_seconds(self):
        peer = SilentPeer()
        self.addCleanup(peer.close)
        self.master = f"http://127.0.0.1:{peer.port}"
        self.assert_check(self.check("input:=topic", code=1)["picture"], "unknown", "no ROS master answers")

    def ros(self, name, lines):
        """A ROS master, on which the drivers speak, and a vehicle where `name` is one."""
        port = free_port()
        self.master = f"http://127.0.0.1:{port}"
        environment = dict(os.environ, ROS_MASTER_URI=self.master, ROS_HOME=str(self.folder), ROS_IP="127.0.0.1")
        for command in ((shutil.which("rosmaster"), "--core", "-p", str(port)), (sys.executable, "-c", VEHICLE, name, json.dumps(lines))):
            process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(process.wait)
            self.addCleanup(process.kill)
        self.wait_for_publisher("/diagnostics")

    def wait_for_publisher(self, topic):
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            with contextlib.suppress(OSError), xmlrpc.client.ServerProxy(self.master) as master:
                if topic in dict(master.getSystemState("/test")[2][0]):
                    return
            time.sleep(0.1)
        self.fail(f"nobody publishes {topic}")

    @unittest.skipUnless(shutil.which("rosmaster"), "no rosmaster")
    def test_topics_of_drivers_are_heard_before_a_vehicle_runs(self):
        self.ros("driver", {})
        found = self.check("input:=topic")
        for name in ("picture", "receiver"):
            self.assert_check(found[name], "ok")
            self.assertAlmostEqual(found[name]["values"]["rate_hz"], 10, delta=4)
        self.assert_check(found["calibration"], "ok", "640x400")
        self.assertNotIn("running picture", found)
        found = self.check("input:=topic", "image:=front", "camera_info:=fix", "fix:=camera/camera_info")
        self.assert_check(found["picture"], "fault", "nothing came on /front/compressed")
        self.assert_check(found["calibration"], "fault", "another type")
        self.assert_check(found["receiver"], "fault", "another type")

    @unittest.skipUnless(shutil.which("rosmaster"), "no rosmaster")
    def test_a_running_vehicle_is_asked_apart_from_files_and_devices(self):
        self.ros("vehicle", WELL)
        found = self.check("input:=topic")
        for name in ("picture", "broker", "reports", "mounting", "detector"):
            entry = found[f"running {name}"]
            self.assertEqual((entry["status"], entry["source"]), ("ok", "running vehicle"), entry)
        self.assertEqual(found["running picture"]["values"], {"rate_hz": 9.5, "dropped": 0})
        self.assertEqual(found["picture"]["source"], "files and devices")
        self.assertIsNone(found["frames per second"]["values"]["frames_per_second"])
        gps = self.check("input:=topic", "receiver:=gpsd", f"gps_receiver:={{port: {free_port()}}}")
        self.assert_check(gps["running receiver"], "fault", "gps_receiver says nothing")

    @unittest.skipUnless(shutil.which("rosmaster"), "no rosmaster")
    def test_a_running_vehicle_that_is_unwell_is_told(self):
        self.ros("vehicle", UNWELL)
        found = self.check("input:=topic", code=1)
        self.assert_check(found["running picture"], "warning", "behind: dropping frames")
        self.assertGreater(found["running picture"]["values"]["dropped"], 5)
        self.assert_check(found["running mounting"], "warning", "knocked 1 times")
        self.assertIsNone(found["running mounting"]["values"]["pitch_deg"])
        self.assert_check(found["running broker"], "fault", "not connected to b:1: refused [2J")
        self.assert_check(found["running reports"], "warning", "101 reports wait")
        self.assert_check(found["running detector"], "fault", "hazard_detection says nothing")

    def test_a_calibration_that_cannot_be_is_told(self):
        self.assert_check(self.check()["calibration"], "ok", "640x400", "520 pixels")
        for focal, width, words in ((0, 640, "focal length of 0"), (5, 640, "no camera for a road"), (520, 3, "3x400"),
                                    ("[a]", 640, "camera_matrix has no rows"), (".nan", 640, "camera_matrix")):
            self.calibrate(focal, width)
            self.assert_check(self.check()["calibration"], "fault", words)
        whole = CALIBRATION.format(focal=520, width=640)
        (self.folder / "camera.yaml").write_text(whole.replace("distortion_coefficients", "other"))
        self.assert_check(self.check()["calibration"], "fault", "distortion_coefficients has no rows")
        (self.folder / "camera.yaml").write_text("{a: [")
        self.assert_check(self.check()["calibration"], "fault", "is no YAML")
        os.unlink(self.folder / "camera.yaml")
        os.mkfifo(self.folder / "camera.yaml")
        self.assert_check(self.check()["calibration"], "fault", "is no ordinary file")
        self.assert_check(self.check("camera_info_url:=/camera.yaml")["calibration"], "fault", "three slashes")

    def test_a_mounting_in_degrees_and_a_damaged_one_on_disk_are_told(self):
        self.assert_check(self.check("camera_pitch:=4")["mounting"], "fault", "camera_pitch is '4'", "degrees?")
        self.assert_check(self.check("camera_z:=nan")["mounting"], "fault", "camera_z is 'nan'")
        store = self.folder / "remembered/mounting.yaml"
        store.parent.mkdir()
        store.write_text("version: 1\npitch_deg: 8.0\npitch_sigma_deg: 0.1\nend: true\n")
        self.assert_check(self.check()["mounting"], "warning", "earlier drives found 8.0 degrees down")
        self.assert_check(self.check("camera_pitch:=0.14")["mounting"], "ok")
        store.write_text("version: 1\npitch_deg: 8.0\n")
        self.assert_check(self.check()["mounting"], "warning", "is damaged")

    def test_a_dead_camera_is_told(self):
        self.assert_check(self.check("input:=device", "path:=/dev/livemap_no_camera")["picture"], "fault", "No such file")
        self.assert_check(self.check("input:=device", "path:=/dev/null")["picture"], "fault", "is no camera")
        os.mkfifo(self.folder / "video")
        found = self.check("input:=device", f"path:={self.folder}/video")["picture"]
        self.assert_check(found, "fault", "is no camera device")
        found = self.check("input:=video", f"path:={self.folder}/video")["picture"]
        self.assertIn(found["status"], ("fault", "unknown"))
        self.assertIsNone(found["values"]["rate_hz"])

    def test_weights_that_are_not_those_of_the_manifest_are_told(self):
        self.assert_check(self.check()["model"], "ok", "hazards-base")
        self.assert_check(self.check("profile:=small")["model"], "ok", "early-discard")
        for name in ("hazards-small.yaml", "hazards-small.onnx", "hazards-small.pt"):
            shutil.copy(ROOT / "models" / name, self.folder)
        with open(self.folder / "hazards-small.onnx", "ab") as file:
            file.write(b"x")
        other = f"model:={self.folder}/hazards-small.yaml"
        self.assert_check(self.check(other)["model"], "fault", "hazards-small.onnx", "SHA-256")
        os.unlink(self.folder / "hazards-small.onnx")
        self.assert_check(self.check(other)["model"], "fault", "cannot be read")

    def test_frames_per_second_are_measured_or_unknown_and_never_0(self):
        for program in ("#!/bin/sh\nexec sleep 100\n", "#!/bin/sh\necho 'no such model' >&2\nexit 1\n"):
            self.install(program)
            entry = self.check()["frames per second"]
            self.assertEqual((entry["status"], entry["values"]["frames_per_second"]), ("unknown", None), entry)
        self.assertIn("no such model", entry["reason"])
        (self.programs / "livemap_detect_image").unlink()
        self.assert_check(self.check()["frames per second"], "unknown", "not built")

    def test_a_certificate_that_is_missing_or_wrong_is_told_by_itself_and_by_the_broker(self):
        zone = self.zone()
        zone.enroll("car-1")
        zone.enroll("car-2")
        zone.start()
        good = self.check(*self.by_identity(zone, "car-1"))
        self.assert_check(good["identity"], "ok", "'car-1'", "days left")
        self.assertAlmostEqual(good["identity"]["values"]["days_left"], 730, delta=1.1)
        self.assert_check(good["broker"], "ok", "lets 'car-1' in")
        self.assert_check(self.check(*self.by_identity(zone, "car-1", "/nothing"))["identity"], "fault", "No such file")
        wrong_name = self.check(*self.by_identity(zone, "car-3", zone.identity("car-1")))
        self.assert_check(wrong_name["identity"], "fault", "is for 'car-1'")
        own = self.folder / "identity"
        shutil.copytree(zone.identity("car-1"), own)
        shutil.copy(zone.identity("car-2") + "/key.pem", own)
        mixed = self.check(*self.by_identity(zone, "car-1", own))
        self.assert_check(mixed["identity"], "fault", "the key is not that of the certificate")
        self.assert_check(mixed["broker"], "unknown", "the identity cannot be used")
        shutil.copy(zone.identity("car-1") + "/key.pem", own)
        (own / "key.pem").chmod(0o644)
        self.assert_check(self.check(*self.by_identity(zone, "car-1", own))["identity"], "warning", "may read the key")
        zone.revoke("car-1")
        (own / "key.pem").chmod(0o600)
        revoked = self.check(*self.by_identity(zone, "car-1", own), code=1)
        self.assert_check(revoked["identity"], "ok")
        self.assert_check(revoked["broker"], "fault", "refuses")

    def test_an_expired_certificate_and_one_of_another_zone_are_told(self):
        zone, other = self.zone(), self.zone()
        zone.enroll("car-1")
        other.enroll("car-1")
        zone.start()
        strange = self.check(*self.by_identity(zone, "car-1", other.identity("car-1")))
        self.assert_check(strange["identity"], "ok")
        self.assert_check(strange["broker"], "fault", "this vehicle refuses the certificate")
        folder = zone.identity("car-1")
        with open(folder + "/key.pem", "rb") as file:
            key = serialization.load_pem_private_key(file.read(), None).public_key()
        for days, status, words in ((-1 / 24 / 60, "fault", "the certificate ended"), (5, "warning", "5 days left")):
            with Authority.open(zone.directory) as authority:
                short = authority.sign("car-1", key, datetime.timedelta(days=days), ExtendedKeyUsageOID.CLIENT_AUTH)
            pathlib.Path(folder, "certificate.pem").write_bytes(certificate_pem(short))
            found = self.check(*self.by_identity(zone, "car-1"))
            self.assert_check(found["identity"], status, words)
            self.assertEqual(found["broker"]["status"], "fault" if days < 0 else "ok", found["broker"])

    def test_a_broker_that_is_dead_silent_or_none_is_told_in_seconds(self):
        zone = self.zone()
        zone.enroll("car-1")
        self.assert_check(self.check(*self.by_identity(zone, "car-1"))["broker"], "fault", "Connection refused")
        for words, answer in ((b"", "says nothing"), (b"HTTP/1.1 400 Bad\r\n\r\n", "is no MQTT broker"),
                              (b" \x03\x00\x86\x00", "wrong user name or password")):
            peer = SilentPeer(words)
            self.addCleanup(peer.close)
            found = self.check(f"broker_port:={peer.port}", code=1)
            self.assert_check(found["broker"], "fault", answer)
            found = self.check(*self.by_identity(zone, "car-1")[:1], f"broker_port:={peer.port}", "vehicle:=car-1")
            self.assert_check(found["broker"], "fault")

    def test_a_plain_broker_far_away_is_warned_of(self):
        self.assert_check(self.check()["identity"], "ok", "on this computer")
        found = self.check("broker_host:=livemap.invalid")
        self.assert_check(found["identity"], "warning", "reads along")
        self.assert_check(found["broker"], "fault")
        found = self.check("password_file:=/nothing")
        self.assert_check(found["identity"], "fault", "No such file")

    def test_a_gpsd_that_is_dead_or_silent_is_told(self):
        self.assert_check(self.check("receiver:=gpsd", f"gps_receiver:={{port: {free_port()}}}")["receiver"], "fault", "no gpsd")
        for words in (b"", b"\x1b[2Jhello\n" * 10, b'[{"class":' * 5000 + b"\n"):
            peer = SilentPeer(words)
            self.addCleanup(peer.close)
            found = self.check("receiver:=gpsd", f"gps_receiver:={{port: {peer.port}}}", code=1)
            self.assert_check(found["receiver"], "fault", "says nothing")
            self.assertIsNone(found["clock"]["values"]["offset_s"])

    @unittest.skipUnless(GPSD and gps_fake, "no gpsd or gpsfake")
    def test_a_receiver_without_fix_or_with_another_time_is_told(self):
        for options, name, words in (({"valid": False}, "receiver", "has no fix"), ({"plugged": False}, "receiver", "no receiver"),
                                     ({"ahead_s": 60.0}, "clock", "behind the receiver's")):
            satellites = SatelliteReceiver(**options)
            self.addCleanup(satellites.close)
            found = self.check("receiver:=gpsd", f"gps_receiver:={{port: {satellites.port}}}", code=1)
            self.assert_check(found[name], "fault", words)

    def test_text_of_devices_and_peers_moves_no_cursor(self):
        hostile = "a\x1b[2J\x07b\u202ec\u2028d\x9be"
        self.assertEqual(clean(hostile), "a [2J b c d e")
        self.assertLessEqual(len(clean("x" * 10_000)), 240)
        peer = SilentPeer(json.dumps({"class": "VERSION", "release": "3"}).encode() + b"\n"
                          + json.dumps({"class": "DEVICES", "devices": [{"path": hostile}]}).encode() + b"\n"
                          + json.dumps({"class": "TPV", "mode": 1, "device": hostile}).encode() + b"\n")
        self.addCleanup(peer.close)
        arguments = ("receiver:=gpsd", f"gps_receiver:={{port: {peer.port}}}")
        self.assert_check(self.check(*arguments)["receiver"], "fault", "a [2J b c d e has no fix")
        shown = self.run_check(*arguments).stdout
        self.assertFalse([c for c in shown if ord(c) < 32 and c != "\n" or c in "\x9b\u202e\u2028"], repr(shown))


def tests_of(suite):
    for entry in suite:
        yield from tests_of(entry) if isinstance(entry, unittest.TestSuite) else (entry,)


def run_side_by_side(workers):
    """Most of a check is waiting for what does not answer, so the tests run beside one another. The number that failed."""
    def run(test):
        result, begin = unittest.TestResult(), time.monotonic()
        test.run(result)
        return test, result, time.monotonic() - begin

    failed = 0
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for done in concurrent.futures.as_completed(
                [pool.submit(run, test) for test in tests_of(unittest.defaultTestLoader.loadTestsFromTestCase(VehicleCheckTest))]):
            test, result, seconds = done.result()
            faults = [trace for _, trace in result.failures + result.errors]
            failed += bool(faults)
            skipped = "".join(reason for _, reason in result.skipped)
            print(f"{test.id()}: {'FAILED' if faults else f'skipped: {skipped}' if skipped else 'ok'}, {seconds:.1f} s",
                  *faults, sep="\n", flush=True)
    return failed


if __name__ == "__main__":
    if len(sys.argv) > 1:
        unittest.main()
    sys.exit(1 if run_side_by_side(WORKERS) else 0)
