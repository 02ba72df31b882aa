#!/usr/bin/python3
"""edge_vo with one eye as a vehicle runs it: a simulated drive through camera_ingest into the nodelet, without depth."""

import copy
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import numpy
import rosbag
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, NavSatFix

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import NodeletUnderTest, eventually, parameters_of, program  # noqa: E402

IMAGE, INFO, FIX, WHEELS = "camera/image_raw/compressed", "camera/camera_info", "fix", "wheel/twist"
CLASSES = {IMAGE: CompressedImage, INFO: CameraInfo, FIX: NavSatFix, WHEELS: TwistWithCovarianceStamped}
DEPTH, RECEIVER = "camera/depth/image_raw", "gps/velocity"
SECONDS, RATE_HZ = 6, 10
# Of the true boxes' depth nothing is needed: any depth of the right size will do.
SIZE = (320, 240)


def run(tool, *arguments):
    done = subprocess.run([program("livemap", tool), *map(str, arguments)], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


def place(odometry):
    point = odometry.pose.pose.position
    return numpy.array([point.x, point.y])


def way(places):
    return numpy.linalg.norm(numpy.diff(places, axis=0), axis=1).sum()


class Vehicle(NodeletUnderTest):
    def __init__(self, name):
        super().__init__(name, "edge_vo")
        topics = {**CLASSES, DEPTH: Image, RECEIVER: TwistWithCovarianceStamped}
        self.inputs = {topic: self.advertise(topic, message) for topic, message in topics.items()}
        self.odometry = self.subscribe("odom", Odometry)
        self.start_nodelet("manager", "manager")

    def load(self, **parameters):
        values = dict(parameters_of("edge_vo"), diagnostics_period_s=0.2, **parameters)
        rospy.set_param(f"/{self.name}/edge_vo", values)
        rospy.set_param(f"/{self.name}/camera_ingest", dict(parameters_of("camera_ingest"), transport="compressed"))
        self.start_nodelet("camera_ingest", "load", "livemap/CameraIngestNodelet", "manager")
        self.start_nodelet("edge_vo", "load", "livemap/EdgeVoNodelet", "manager")
        for topic in (IMAGE, INFO, FIX):
            eventually(lambda t=topic: self.inputs[t].get_num_connections() > 0, f"it listens to {topic}")
        if parameters.get("wheel_velocity_topic"):
            eventually(lambda: self.inputs[WHEELS].get_num_connections() > 0, "it listens to the wheels")
        eventually(lambda: self.odometry.get_num_connections() > 0, "it speaks")

    def done(self):
        values = self.diagnostics()
        return int(values.get("frames", 0)) + int(values.get("frames_dropped", 0))


class OneEyeTest(unittest.TestCase):
    number = 0

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="livemap_one_eye_")
        bag = os.path.join(cls.folder, "drive.bag")
        run("livemap_simulate", "--seed", 7, "--seconds", SECONDS, "--rate", RATE_HZ, "--size", f"{SIZE[0]}x{SIZE[1]}",
               "--one-ray", "--multipath-m", 0, "--fix-noise-m", 0.1, "--bag", bag)
        with rosbag.Bag(bag) as recorded:
            cls.messages = [(topic.lstrip("/"), message) for topic, message, _ in
                            recorded.read_messages(["/" + topic for topic in CLASSES])]
            cls.truth = {message.header.stamp: place(message) for _, message, _ in
                         recorded.read_messages("/ground_truth/odom")}
            mounting = next(message for _, message, _ in recorded.read_messages("/tf_static")).transforms
        cls.static = tf2_ros.StaticTransformBroadcaster()
        cls.static.sendTransform(mounting)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def loaded(self, **parameters):
        OneEyeTest.number += 1
        vehicle = Vehicle(f"vehicle{OneEyeTest.number}")
        self.addCleanup(vehicle.stop)
        vehicle.load(**parameters)
        return vehicle

    def play(self, vehicle, topics, seconds=SECONDS, mono_from_s=0.0, depth_from_s=None):
        """Message by message; each image is waited for where it is followed with one eye."""
        first = next(message for topic, message in self.messages if topic == IMAGE).header.stamp
        followed = vehicle.done()
        for topic, message in self.messages:
            age_s = (message.header.stamp - first).to_sec()
            if topic not in (*topics, IMAGE, INFO) or age_s > seconds:
                continue
            if topic == IMAGE and depth_from_s is not None and age_s >= depth_from_s:
                vehicle.inputs[DEPTH].publish(Image(header=message.header, width=SIZE[0], height=SIZE[1], encoding="16UC1",
                                                    step=2 * SIZE[0], data=numpy.full(SIZE[0] * SIZE[1], 8000, "<u2").tobytes()))
            vehicle.inputs[topic].publish(message)
            if topic == IMAGE and age_s >= mono_from_s:
                followed += 1
                eventually(lambda n=followed: vehicle.done() >= n, "the image is followed")
            else:
                time.sleep(0.002)

    def assert_follows_the_street(self, vehicle, share):
        poses = vehicle.received("odom")
        self.assertGreater(len(poses), 0.6 * SECONDS * RATE_HZ)
        driven = way([place(pose) for pose in poses])
        true = way([self.truth[pose.header.stamp] for pose in poses])
        self.assertGreater(true, 20)
        self.assertLess(abs(driven / true - 1), share, f"{driven:.2f} m instead of {true:.2f} m")
        for pose in poses[1:]:
            twist = numpy.array(pose.twist.covariance).reshape(6, 6)
            self.assertGreater(numpy.linalg.eigvalsh(twist).min(), 0)

    def test_the_wheels_speed_gives_the_path_its_metres(self):
        vehicle = self.loaded(eye="mono", wheel_velocity_topic=WHEELS)
        self.play(vehicle, (WHEELS, FIX))
        vehicle.wait_for(eye="mono", state="tracking", metres="wheels", frames_dropped=0)
        self.assert_follows_the_street(vehicle, 0.03)
        self.assertLess(float(vehicle.diagnostics()["metres_sigma"]), 0.05)

    def test_without_any_speed_fixes_give_it_and_without_them_the_height_of_the_camera(self):
        by_fixes, by_height = self.loaded(eye="mono"), self.loaded(eye="mono", background_keyframes=False)
        self.play(by_fixes, (FIX,))
        by_fixes.wait_for(state="tracking", metres="fixes")
        self.assert_follows_the_street(by_fixes, 0.06)
        self.play(by_height, ())
        by_height.wait_for(state="tracking", metres="height")
        self.assert_follows_the_street(by_height, 0.12)

    def test_images_without_depth_are_followed_with_one_eye_after_a_while_and_depth_takes_over_once(self):
        vehicle = self.loaded(eye="auto", eye_wait_s=0.45, wheel_velocity_topic=WHEELS)
        self.play(vehicle, (WHEELS,), mono_from_s=0.5, seconds=2.5)
        vehicle.wait_for(eye="mono", state="tracking")
        before = vehicle.received("odom")[-1]
        next_image = [message for topic, message in self.messages if topic == IMAGE][26]
        self.messages = [m for m in self.messages if m[1].header.stamp >= next_image.header.stamp]
        self.play(vehicle, (WHEELS,), depth_from_s=0.3, mono_from_s=99)
        eventually(lambda: vehicle.diagnostics().get("eye") == "depth", "depth takes over")
        after = next(pose for pose in vehicle.received("odom") if pose.header.stamp > before.header.stamp)
        self.assertLess(numpy.linalg.norm(place(after) - place(before)), 3.0, "the path goes on where it was")

    def test_a_standing_vehicle_has_no_odometry_yet_and_does_not_drift(self):
        vehicle = self.loaded(eye="mono")
        image, info = (copy.deepcopy(next(message for topic, message in self.messages if topic == wanted))
                       for wanted in (IMAGE, INFO))
        for i in range(15):
            image.header.stamp += rospy.Duration(0.1)
            info.header.stamp = image.header.stamp
            vehicle.inputs[INFO].publish(info)
            vehicle.inputs[IMAGE].publish(image)
            eventually(lambda n=i + 1: vehicle.done() >= n, "the image is looked at")
        vehicle.wait_for(state="initialising", metres="none", frames=15)
        self.assertEqual(vehicle.received("odom"), [])


if __name__ == "__main__":
    rospy.init_node("edge_vo_mono_test")
    rostest.rosrun("livemap", "edge_vo_mono_test", OneEyeTest, sys.argv)
