#!/usr/bin/python3
"""Stamps that cannot be and time that goes back: a vehicle's nodelets in one manager, driven by a bag that is played
again and again with its clock (rosbag play --loop --clock)."""

import os
import pathlib
import sys
import tempfile
import threading
import unittest

import numpy
import rosbag
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, NavSatFix
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from hazard_reporting_fixture import OPTICAL, SPEED_MPS, detection, detections, fix, stamp  # noqa: E402
from livemap.msg import DetectionArray, HazardReport, VehiclePosition  # noqa: E402
from node_testing import SOURCE_DIRECTORY, eventually, program, start_child  # noqa: E402
from nodelet_manager import NodeletManager  # noqa: E402

ROUND_S = 8.0
WIDTH, HEIGHT = 160, 100
YEAR = rospy.Duration(365 * 86400)
MODELS = pathlib.Path(SOURCE_DIRECTORY) / "models"
# Of each nodelet, what rises as long as it works.
WORK = {"camera_ingest": "frames_published", "hazard_detection": "frames_processed", "edge_vo": "frames",
        "geo_localization": "poses_published", "change_detection": "frames_looked_at",
        "early_discard": "frames_judged", "hazard_reporting": "fixes"}


def picture(time_s, encoding="bgr8"):
    message = Image(width=WIDTH, height=HEIGHT, encoding=encoding)
    message.header.stamp, message.header.frame_id = stamp(time_s), OPTICAL
    random = numpy.random.default_rng(round(10 * time_s))
    if encoding == "bgr8":
        pixels = numpy.kron(random.integers(0, 255, (10, 16, 3)), numpy.ones((10, 10, 1))).astype(numpy.uint8)
    else:
        pixels = numpy.full((HEIGHT, WIDTH), 5000, numpy.uint16)
    message.step, message.data = pixels.strides[0], pixels.tobytes()
    return message


def calibration(time_s):
    info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=[0.0] * 5)
    info.header.stamp, info.header.frame_id = stamp(time_s), OPTICAL
    info.K = [125, 0, 80, 0, 125, 50, 0, 0, 1]
    info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    info.P = [125, 0, 80, 0, 0, 125, 50, 0, 0, 0, 1, 0]
    return info


def odometry(time_s):
    message = Odometry(child_frame_id="base_link")
    message.header.stamp, message.header.frame_id = stamp(time_s), "odom"
    message.pose.pose.position.x = SPEED_MPS * time_s
    message.pose.pose.orientation.w = 1
    message.twist.twist.linear.x = SPEED_MPS
    return message


def mounting():
    transform = TransformStamped(child_frame_id=OPTICAL)
    transform.header.frame_id = "base_link"
    transform.transform.translation.x, transform.transform.translation.z = 1.5, 1.6
    rotation = transform.transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = -0.5, 0.5, -0.5, 0.5
    return TFMessage([transform])


def seen(time_s, *found):
    """The fixture's detections for this camera, a quarter of the fixture's."""
    message = detections(time_s, *found)
    message.image_width, message.image_height = WIDTH, HEIGHT
    for each in message.detections:
        each.x_min, each.x_max, each.y_min, each.y_max = (v / 4 for v in (each.x_min, each.x_max, each.y_min, each.y_max))
    return message


def write_bag(path):
    """A drive with one pothole 20 m ahead of where it is at 4 s."""
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/tf_static", mounting(), stamp(0.01))
        for i in range(1, round(50 * ROUND_S)):
            time_s = i / 50
            bag.write("/odom", odometry(time_s), stamp(time_s))
            if i % 5:
                continue
            bag.write("/fix", fix(time_s), stamp(time_s))
            bag.write("/camera/camera_info", calibration(time_s), stamp(time_s))
            bag.write("/camera/image_raw", picture(time_s), stamp(time_s))
            bag.write("/camera/depth/image_raw", picture(time_s, "16UC1"), stamp(time_s))
            ahead_m = 20 + SPEED_MPS * (4 - time_s)
            bag.write("/hazard/detections", seen(time_s, *([detection(ahead_m)] if 8 < ahead_m < 24 else [])),
                      stamp(time_s))


class TimeGoesBackTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = pathlib.Path(cls.folder.name)
        write_bag(path / "drive.bag")
        cls.lock = threading.Lock()
        cls.values, cls.positions, cls.reports, cls.fused = {}, [], [], []
        cls.rounds, cls.now = 1, rospy.Time()
        rospy.Subscriber("/clock", Clock, cls.on_clock, queue_size=1000)
        rospy.Subscriber("/diagnostics", DiagnosticArray, cls.on_diagnostics)
        rospy.Subscriber("/vehicle/position", VehiclePosition, lambda m: cls.positions.append((cls.rounds, m)))
        rospy.Subscriber("/hazard/report", HazardReport, lambda m: cls.reports.append((cls.rounds, m)))
        rospy.Subscriber("/localization/odometry", Odometry, lambda m: cls.fused.append((cls.rounds, m)))
        cls.ends = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in (
            ("/fix", NavSatFix), ("/odom", Odometry), ("/hazard/detections", DetectionArray),
            ("/camera/image_raw", Image), ("/camera/depth/image_raw", Image), ("/camera_rect/image", Image),
            ("/tf", TFMessage))}
        cls.buffer = tf2_ros.Buffer(rospy.Duration(10))
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        cls.manager = NodeletManager()
        diagnosed = {"diagnostics_period_s": 0.2}
        for node, parameters, remap in (
                ("camera_ingest", {"transport": "raw"}, {}),
                ("hazard_detection", {"model": str(MODELS / "hazards-base.yaml"), "tracking": True},
                 {"/hazard/detections": "/own/detections", "/hazard/events": "/own/events"}),
                ("edge_vo", {"publish_tf": False}, {"/odom": "/own/odom"}),
                ("geo_localization", {"publish_tf": False, "latency_s": 0.0, "latency_sigma_s": 0.0}, {}),
                ("change_detection", {"method": "daisy", "directory": str(path / "places")}, {}),
                ("early_discard", {"model": str(MODELS / "early-discard.yaml")}, {}),
                ("hazard_reporting", {"database": str(path / "hazards.sqlite3"), "use_events": False,
                                      "position_period_s": 0.1, "publish_tf": True,
                                      "resend_first_s": 0.3, "resend_longest_s": 0.5}, {})):
            assert cls.manager.load(node, node, dict(parameters, **diagnosed), remap), cls.manager.output()
        cls.player = start_child([program("rosbag", "play"), "--quiet", "--loop", "--clock", "--hz=100",
                                  str(path / "drive.bag")])

    @classmethod
    def tearDownClass(cls):
        for process in (cls.player,):
            process.terminate()
            process.wait()
        cls.manager.stop()
        cls.folder.cleanup()

    @classmethod
    def on_clock(cls, message):
        if message.clock + rospy.Duration(1) < cls.now:
            cls.rounds += 1
        cls.now = message.clock

    @classmethod
    def on_diagnostics(cls, message):
        with cls.lock:
            for status in message.status:
                node = status.name.split(":")[0].strip("/ ")
                cls.values.setdefault(node, {}).update({value.key: value.value for value in status.values})

    @classmethod
    def figure(cls, node, key):
        with cls.lock:
            return float(cls.values.get(node, {}).get(key, 0))

    def await_round(self, number):
        eventually(lambda: self.rounds >= number, f"round {number}")

    def assert_all_work(self, what):
        self.assertTrue(self.manager.is_alive(), self.manager.output()[-3000:])
        before = {node: self.figure(node, key) for node, key in WORK.items()}
        for node, key in WORK.items():
            eventually(lambda n=node, k=key: self.figure(n, k) > before[n] + 3, f"{node}: {key} rises {what}")

    def test_1_every_nodelet_works_in_the_first_round_and_in_those_after(self):
        self.assert_all_work("in the first round")
        for number in (2, 3):
            self.await_round(number)
            self.assert_all_work(f"in round {number}")
        for node in WORK:
            key = "begun_anew" if node == "geo_localization" else "time_resets"
            eventually(lambda n=node, k=key: self.figure(n, k) >= 2, f"{node} has begun anew")
            self.assertLessEqual(self.figure(node, key), self.rounds, node)

    def test_2_positions_and_fused_poses_go_on_in_each_round(self):
        self.await_round(3)
        for messages, what in ((self.positions, "positions"), (self.fused, "fused poses")):
            for number in (1, 2):
                self.assertGreater(len([1 for each, _ in messages if each == number]), 10, f"{what} of round {number}")

    def test_3_a_known_hazard_is_no_new_one_in_the_next_round_and_a_new_one_is_reported(self):
        eventually(lambda: self.reports, "the pothole is reported")
        known = {bytes(report.uuid) for _, report in self.reports}
        self.assertEqual(len(known), 1)
        number = self.rounds + 1
        self.await_round(number)
        eventually(lambda: [1 for each, _ in self.reports if each >= number], "the unfinished report is sent again")
        eventually(lambda: self.now > stamp(2), "the vehicle moves")
        self.assertEqual({bytes(report.uuid) for _, report in self.reports}, known)

        def report_of_another():
            time_s = (self.now - stamp(0)).to_sec()
            self.ends["/hazard/detections"].publish(seen(time_s, detection(9, 1, "manhole")))
            return {bytes(report.uuid) for _, report in self.reports} - known

        eventually(report_of_another, "another hazard is reported")

    def test_4_stamps_of_the_future_and_the_past_are_refused_counted_and_harm_nothing(self):
        def refused():
            return {node: self.figure(node, "stamps_refused") for node in WORK}

        before = refused()
        for shift in (YEAR, -YEAR):
            time_s = (self.now - stamp(0)).to_sec()
            transform = mounting()
            transform.transforms[0].header.stamp = stamp(time_s) + shift
            self.ends["/tf"].publish(transform)
            for topic, message in (("/fix", fix(time_s)), ("/odom", odometry(time_s)),
                                   ("/hazard/detections", seen(time_s)), ("/camera/image_raw", picture(time_s)),
                                   ("/camera_rect/image", picture(time_s)),
                                   ("/camera/depth/image_raw", picture(time_s, "16UC1"))):
                message.header.stamp += shift
                self.ends[topic].publish(message)
            for node in WORK:
                eventually(lambda n=node: self.figure(n, "stamps_refused") > before[n], f"{node} has refused one")
            self.assert_all_work("after stamps that cannot be")
            before = refused()
        eventually(lambda: "ahead of the clock" in self.manager.output(), "it says so")

        def is_fresh():
            try:
                newest = self.buffer.lookup_transform("map", "base_link", rospy.Time(0)).header.stamp
            except tf2_ros.TransformException:
                return False
            return abs((newest - self.now).to_sec()) < 2

        eventually(is_fresh, "map -> base_link follows the clock")


if __name__ == "__main__":
    rospy.set_param("/use_sim_time", True)
    rospy.init_node("time_goes_back_test", anonymous=True)
    rostest.rosrun("livemap", "time_goes_back", TimeGoesBackTest)
