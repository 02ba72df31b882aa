#!/usr/bin/python3
"""The small vehicle cloudlet end to end: early discard on board, the zone's detector, the zone's map.

Everything is real: two ROS masters, mosquitto with its rights, the launch files' vehicle and zone. The models are
those of test/perception/inference/make_tiny_model.py: a red block is a hazard worth sending, and a pothole.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import unittest

import cv2
import numpy
import rosbag
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from livemap.msg import CandidateFrame, HazardReport
from sensor_msgs.msg import CameraInfo, Image, NavSatFix, NavSatStatus

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
from hazard_reporting_fixture import east_north, place  # noqa: E402
from mqtt_bridge_fixture import envelope  # noqa: E402
from node_testing import eventually  # noqa: E402

ZONE, VEHICLE, OTHER = "test", "car-1", "car-2"
RATE_HZ, SPEED_MPS, SECONDS = 3, 10.0, 12
EPOCH_S = 1_767_268_800  # 2026-01-01T12:00:00Z
WIDTH, HEIGHT, FOCAL_PX = 640, 400, 500.0
CAMERA_FORWARD_M, CAMERA_HEIGHT_M = 1.5, 1.6
# A cell of the tiny detector, 80 px here; its box is twice as wide, around the same middle.
BLOCK = (slice(240, 320), slice(240, 320))
FORWARD_M = CAMERA_FORWARD_M + FOCAL_PX * CAMERA_HEIGHT_M / (320 - HEIGHT / 2)
LEFT_M = (WIDTH / 2 - 280) / FOCAL_PX * (FORWARD_M - CAMERA_FORWARD_M)
HAZARD_FRAMES = (12, 24)
FACE = (slice(85, 140), slice(455, 505))
SMALL_MODEL = ROOT / "test" / "perception" / "inference" / "tiny_score.yaml"
BIG_MODEL = ROOT / "test" / "perception" / "inference" / "tiny.yaml"


def street(hazard):
    """A grey street with a drawn face, and a red block where there is a hazard."""
    pixels = numpy.random.RandomState(7).normal(120, 6, (HEIGHT, WIDTH, 3)).clip(0, 255).astype(numpy.uint8)
    height, centre = 80, numpy.array((480, 110))

    def part(x, y, width, part_height, grey):
        middle = centre + numpy.rint(numpy.array((x, y)) * height).astype(int)
        axes = (max(1, round(width * height)), max(1, round(part_height * height)))
        cv2.ellipse(pixels, tuple(map(int, middle)), axes, 0, 0, 360, (grey,) * 3, cv2.FILLED, cv2.LINE_AA)

    part(0, -0.15, 0.48, 0.55, 40)
    part(0, 0, 0.40, 0.52, 178)
    for side in (-0.17, 0.17):
        part(side, -0.10, 0.10, 0.05, 117)
        part(side, -0.10, 0.07, 0.03, 240)
        part(side, -0.10, 0.03, 0.03, 20)
        part(side, -0.19, 0.10, 0.03, 42)
    part(0, 0.08, 0.06, 0.10, 158)
    part(0, 0.30, 0.15, 0.04, 97)
    pixels = cv2.merge([cv2.cvtColor(cv2.GaussianBlur(pixels, (0, 0), 1.0), cv2.COLOR_BGR2GRAY)] * 3)
    if hazard:
        pixels[BLOCK] = (0, 0, 255)
    return pixels


def stamp(seconds):
    return rospy.Time(EPOCH_S) + rospy.Duration(seconds)


def write_bag(path):
    """A drive to the north at a constant speed, three pictures a second."""
    with rosbag.Bag(str(path), "w") as bag:
        for tick in range(-5, 5 * (SECONDS + 2)):
            fix = NavSatFix()
            fix.header.stamp = stamp(1 + tick / 5)
            fix.status.status = NavSatStatus.STATUS_FIX
            fix.latitude, fix.longitude = place(0, SPEED_MPS * tick / 5)
            fix.position_covariance = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.04]
            fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
            bag.write("/fix", fix, fix.header.stamp)
        for number in range(RATE_HZ * SECONDS):
            image = Image(width=WIDTH, height=HEIGHT, encoding="bgr8", step=3 * WIDTH)
            image.header.stamp = stamp(1 + number / RATE_HZ)
            image.header.frame_id = "camera_optical_frame"
            image.data = street(number in HAZARD_FRAMES).tobytes()
            info = CameraInfo(header=image.header, width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=[0] * 5)
            info.K = [FOCAL_PX, 0, WIDTH / 2 - 0.5, 0, FOCAL_PX, HEIGHT / 2 - 0.5, 0, 0, 1]
            info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
            info.P = [FOCAL_PX, 0, WIDTH / 2 - 0.5, 0, 0, FOCAL_PX, HEIGHT / 2 - 0.5, 0, 0, 0, 1, 0]
            bag.write("/camera/camera_info", info, image.header.stamp)
            bag.write("/camera/image_raw", image, image.header.stamp)


def true_places():
    """East and north of the hazards, metres."""
    # A pothole's middle lies 0.4 m behind its near edge (config/hazards.yaml), seen from the vehicle.
    farther = 1 + 0.4 / numpy.hypot(FORWARD_M, LEFT_M)
    return [(-farther * LEFT_M, SPEED_MPS * number / RATE_HZ + farther * FORWARD_M) for number in HAZARD_FRAMES]


class Drive(system.LiveMapSystem):
    """One replay of the bag by a vehicle of a profile, with a zone of its own."""

    def __init__(self, directory, profile, zone_master=None):
        directory.mkdir()
        super().__init__(directory, ZONE, f"{VEHICLE},{OTHER}")
        self.profile = profile
        self.zone_master_of_test = zone_master

    def launch(self, name, port, file, arguments):
        """On the master that rostest started, where one is given for the zone."""
        if file == "zone.launch":
            arguments = dict(arguments, model=BIG_MODEL)
            if self.zone_master_of_test:
                self.start(name, ["roslaunch", "--wait", system.launch_file(file)] +
                           [f"{key}:={value}" for key, value in arguments.items()], master=self.zone_master_of_test)
                return
        super().launch(name, port, file, arguments)

    def drive(self, bag):
        self.start_broker()
        self.launch_zone()
        self.vehicle = VEHICLE
        self.start_vehicle(bag, 1.0, profile=self.profile, model=BIG_MODEL, discard_model=SMALL_MODEL,
                           transport="raw", delay=0, camera_x=CAMERA_FORWARD_M, camera_z=CAMERA_HEIGHT_M,
                           publish_mounting="true")
        self.map = observers.MapClient(self.url)
        self.wait_for("the vehicle's nodelets", self.vehicle_listens, timeout_s=180)
        self.play()

    def vehicle_listens(self):
        """Whether the nodelet that matters subscribes to the camera and the bridge to what it sends."""
        environment = dict(os.environ, ROS_MASTER_URI=self.vehicle_master)
        wanted = {"small": ["/candidate/frame", "/fix"], "big": ["/hazard/detections", "/hazard/report", "/fix"]}
        listening = subprocess.run(["rostopic", "list", "-s"], env=environment, capture_output=True, text=True).stdout
        return all(topic in listening for topic in wanted[self.profile])

    def hazards(self):
        return [east_north(hazard["latitude"], hazard["longitude"]) for hazard in self.map.stored_hazards()]


class SmallVehicleTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("small_vehicle_test")
        cls.lock = threading.Lock()
        cls.frames, cls.reports, cls.status = [], [], {}
        cls.ends = [rospy.Subscriber("/candidate/frame", CandidateFrame, cls.keep, cls.frames),
                    rospy.Subscriber("/hazard/report", HazardReport, cls.keep, cls.reports),
                    rospy.Subscriber("/diagnostics", DiagnosticArray, cls.note)]
        cls.directory = pathlib.Path(tempfile.mkdtemp(prefix="small_vehicle_"))
        cls.bag = cls.directory / "drive.bag"
        write_bag(cls.bag)
        cls.small = Drive(cls.directory / "small", "small", os.environ["ROS_MASTER_URI"])
        cls.small.drive(cls.bag)

    @classmethod
    def tearDownClass(cls):
        cls.small.__exit__()

    @classmethod
    def keep(cls, message, kept):
        with cls.lock:
            kept.append(message)

    @classmethod
    def note(cls, message):
        for status in message.status:
            if status.hardware_id == "candidate_intake":
                cls.status = {pair.key: pair.value for pair in status.values}

    def test_1_the_hazards_are_on_the_map_where_they_are(self):
        eventually(lambda: len(self.small.hazards()) >= len(HAZARD_FRAMES), "both hazards on the map")
        self.assert_near(self.small.hazards(), true_places(), 0.3)

    def test_2_only_the_frames_with_a_hazard_left_the_car(self):
        # The last frame of the drive is over when the vehicle's replay is.
        rospy.sleep(SECONDS - max(HAZARD_FRAMES) / RATE_HZ + 2)
        stamps = sorted(frame.stamp for frame in self.frames)
        self.assertEqual(stamps, [stamp(1 + number / RATE_HZ) for number in HAZARD_FRAMES])
        for frame in self.frames:
            self.assertEqual(frame.vehicle_id, VEHICLE)
            self.assertLessEqual(len(frame.image.data), 40000)
        eventually(lambda: self.status.get("frames_detected") == str(len(HAZARD_FRAMES)), "the detector saw them")
        self.assertEqual(self.status["frames_refused"], "0")

    def test_3_no_face_left_the_car(self):
        clear = cv2.cvtColor(street(True)[FACE], cv2.COLOR_BGR2GRAY).astype(float)
        for frame in self.frames:
            pixels = cv2.imdecode(numpy.frombuffer(frame.image.data, numpy.uint8), cv2.IMREAD_GRAYSCALE)
            self.assertEqual(pixels.shape, (HEIGHT, WIDTH))
            masked = pixels[FACE].astype(float)
            self.assertGreater(numpy.abs(masked - clear).mean(), 15, "the face is as it was")

    def test_4_a_report_is_the_vehicles_with_a_picture(self):
        reports = list(self.reports)
        # The tiny model draws two boxes around a block: two reports, which the registry merges.
        self.assertEqual({report.stamp for report in reports}, {frame.stamp for frame in self.frames})
        for report in reports:
            self.assertEqual((report.vehicle_id, report.class_name), (VEHICLE, "pothole"))
            self.assertEqual((report.image_width, report.image_height), (WIDTH, HEIGHT))
            self.assertEqual(report.image.format, "jpeg")
            picture = cv2.imdecode(numpy.frombuffer(report.image.data, numpy.uint8), cv2.IMREAD_COLOR)
            self.assertIsNotNone(picture)

    def test_5_a_forged_vehicle_id_is_overwritten_and_a_foreign_topic_refused(self):
        forged = self.frames[0]
        forged.vehicle_id = OTHER
        forged.stamp += rospy.Duration(0, 1_000_000)
        before = len(self.frames)
        self.assertEqual(self.publish(VEHICLE, forged), 0)
        eventually(lambda: len(self.frames) > before, "the forged frame arrives")
        self.assertEqual(self.frames[-1].stamp, forged.stamp)
        self.assertEqual(self.frames[-1].vehicle_id, VEHICLE)
        eventually(lambda: any(report.stamp == forged.stamp for report in self.reports), "it is reported")
        self.assertEqual({report.vehicle_id for report in self.reports}, {VEHICLE})
        forged.stamp += rospy.Duration(0, 1_000_000)
        self.publish(OTHER, forged)  # With the rights of VEHICLE.
        forged.stamp += rospy.Duration(0, 1_000_000)
        self.publish(VEHICLE, forged)
        eventually(lambda: self.frames[-1].stamp == forged.stamp, "the next own frame arrives")
        self.assertEqual(len(self.frames), before + 2, "nothing came by the other vehicle's topic")

    def test_6_a_frame_that_comes_twice_is_one_report(self):
        again = self.frames[0]
        eventually(lambda: (self.status.get("frames_detected"), self.status.get("reports")) ==
                   (str(len(self.frames)), str(len(self.reports))), "all that came before is reported")
        reports = len(self.reports)
        repeated = int(self.status["frames_repeated"])
        self.publish(VEHICLE, again)
        eventually(lambda: int(self.status["frames_repeated"]) > repeated, "it is known again")
        self.assertEqual(len(self.reports), reports)

    def test_7_a_big_vehicle_puts_them_at_the_same_places(self):
        with Drive(self.directory / "big", "big") as big:
            big.drive(self.bag)
            eventually(lambda: len(big.hazards()) >= len(HAZARD_FRAMES), "both hazards on the big vehicle's map")
            # Of the two boxes around a block a big vehicle reports one; the zone has the small one's both, half a metre apart.
            self.assert_near(self.small.hazards(), big.hazards(), 0.3)

    def publish(self, topic_of, message):
        """Publishes with the rights of VEHICLE; the exit code of mosquitto_pub."""
        password = self.small.password_file(VEHICLE).read_text().splitlines()[0]
        with tempfile.NamedTemporaryFile() as file:
            file.write(envelope(message))
            file.flush()
            return subprocess.run(
                ["mosquitto_pub", "-V", "5", "-q", "1", "-p", str(self.small.broker_port), "-u", VEHICLE, "-P", password,
                 "-i", "forger", "-t", f"livemap/v1/{ZONE}/vehicle/{topic_of}/candidate", "-f", file.name],
                check=False, capture_output=True).returncode

    def assert_near(self, found, expected, limit_m):
        self.assertEqual(len(found), len(expected), (found, expected))
        for wanted in expected:
            nearest = min(numpy.hypot(wanted[0] - east, wanted[1] - north) for east, north in found)
            self.assertLess(nearest, limit_m, (found, expected))


if __name__ == "__main__":
    rostest.rosrun("livemap", "small_vehicle", SmallVehicleTest)
