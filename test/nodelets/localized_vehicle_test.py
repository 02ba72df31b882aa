#!/usr/bin/python3
"""A simulated drive through camera_ingest, edge_vo, geo_localization and hazard_reporting in one manager:
the tree of frames is whole, and hazards stand where fused poses and depth put them."""

import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
import rostest
import tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, NavSatFix

from livemap.msg import DetectionArray, HazardReport
sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import NodeletUnderTest, eventually, parameters_of, program  # noqa: E402

DATUM = (50.0, 8.0)
METRES_PER_DEGREE, METRES_PER_DEGREE_EAST = 111229, 71696  # At 50 degrees north.
IMAGE, DEPTH, INFO = "camera/image_raw/compressed", "camera/depth/image_raw", "camera/camera_info"
BOXES, FIX, TRUTH = "ground_truth/boxes", "fix", "ground_truth/odom"
# What the bag calls the detector's answers.
INPUTS = {IMAGE: CompressedImage, DEPTH: Image, INFO: CameraInfo, FIX: NavSatFix, "hazard/detections": DetectionArray}
NODELETS = {"camera_ingest": "CameraIngestNodelet", "edge_vo": "EdgeVoNodelet",
            "geo_localization": "GeoLocalizationNodelet", "hazard_reporting": "HazardReportingNodelet"}


def east_north(latitude, longitude):
    return ((longitude - DATUM[1]) * METRES_PER_DEGREE_EAST, (latitude - DATUM[0]) * METRES_PER_DEGREE)


class Vehicle(NodeletUnderTest):
    def __init__(self, name, directory, **reporting):
        super().__init__(name, "hazard_reporting")
        self.inputs = {topic: self.advertise(topic, kind) for topic, kind in INPUTS.items()}
        self.outputs = [self.subscribe(topic, kind) for topic, kind in (
            ("odom", Odometry), ("localization/odometry", Odometry), ("hazard/report", HazardReport))]
        changes = {
            # The simulated receiver stamps its measurements.
            "geo_localization": {"latency_s": 0.0, "latency_sigma_s": 0.0, "order_wait_s": 1.0,
                                 "map_datum": f"{DATUM[0]},{DATUM[1]}"},
            "hazard_reporting": {"position_source": "fused", "use_depth": True, "fused_wait_s": 5.0,
                                 "depth_wait_s": 5.0, "database": os.path.join(directory, name + ".sqlite3"),
                                 "picture_wait_s": 0.0, "use_events": False, **reporting}}
        self.start_nodelet("manager", "manager")
        for node, kind in NODELETS.items():
            rospy.set_param(f"/{name}/{node}", {**parameters_of(node), "diagnostics_period_s": 0.2,
                                               **changes.get(node, {})})
            self.start_nodelet(node, "load", "livemap/" + kind, "manager")
        eventually(lambda: all(end.get_num_connections() > 0 for end in [*self.inputs.values(), *self.outputs]),
                   "it listens and speaks")

    def play(self, frames):
        """Frame by frame, each until visual odometry has answered it, so that none is dropped."""
        for number, frame in enumerate(frames):
            for topic, message in frame:
                self.inputs[topic].publish(message)
            eventually(lambda n=number: len(self.received("odom")) > n, "the frame is answered")


class LocalizedVehicleTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="livemap_localized_")
        bag, hazards = os.path.join(cls.folder, "drive.bag"), os.path.join(cls.folder, "drive.geojson")
        subprocess.run([program("livemap", "livemap_simulate"), "--seed", "7", "--seconds", "14", "--size", "320x240",
                        "--one-ray", "--bag", bag, "--bag-depth", "--hazards", hazards, "--multipath-m", "0",
                        "--start", "50,8"], check=True, timeout=600, stdout=subprocess.DEVNULL)
        with open(hazards, encoding="utf-8") as file:
            cls.hazards = json.load(file)["features"]
        cls.frames, cls.truth, waiting = [], {}, []
        with rosbag.Bag(bag) as recorded:
            for topic, message, _ in recorded.read_messages():
                topic = topic.lstrip("/").replace(BOXES, "hazard/detections")
                if topic == "tf_static":
                    cls.static = tf2_ros.StaticTransformBroadcaster()
                    cls.static.sendTransform(message.transforms)
                elif topic == TRUTH:
                    cls.truth[message.header.stamp] = message.pose.pose.position
                elif topic in INPUTS:
                    waiting.append((topic, message))
                    # The last of a picture.
                    if topic == DEPTH:
                        cls.frames.append(waiting)
                        waiting = []

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def test_frames_are_one_tree_and_hazards_stand_where_they_are(self):
        buffer = tf2_ros.Buffer(rospy.Duration(100))
        listener = tf2_ros.TransformListener(buffer)
        self.addCleanup(listener.unregister)
        vehicle = Vehicle("localized", self.folder)
        self.addCleanup(vehicle.stop)
        vehicle.play(self.frames)
        poses = eventually(lambda: len(vehicle.received("localization/odometry")) > 60
                           and vehicle.received("localization/odometry"), "fused poses")
        for pose in poses:
            place, true = pose.pose.pose.position, self.truth[pose.header.stamp]
            # Fixes of 0.5 m per axis, the first of them alone decide the heading.
            self.assertLess(math.dist((place.x, place.y), (true.x, true.y)), 1.5)
        stamp = poses[-1].header.stamp
        camera = eventually(lambda: buffer.can_transform("map", "camera_optical_frame", stamp) and
                            buffer.lookup_transform("map", "camera_optical_frame", stamp), "map to camera")
        self.assertAlmostEqual(camera.transform.translation.z, 1.45, delta=0.5)
        self.check_hazards(vehicle)

    def check_hazards(self, vehicle):
        eventually(lambda: int(vehicle.diagnostics().get("waiting_frames", 1)) == 0
                   and int(vehicle.diagnostics().get("settling_reports", 1)) == 0, "all hazards are placed")
        counters = {key: int(value) for key, value in vehicle.diagnostics().items() if value.isdigit()}
        self.assertGreater(counters["placed_by_fusion"], 10)
        self.assertGreater(counters["distances_by_depth"], 10)
        # The counters are read anew each time: the last reports may come after the diagnostics above.
        reports = eventually(lambda: len({bytes(r.uuid) for r in vehicle.received("hazard/report")})
                             == int(vehicle.diagnostics()["reports_created"]) and vehicle.received("hazard/report"),
                             "all reports")
        errors = []
        for report in reports:
            there = east_north(report.latitude, report.longitude)
            errors.append(min(math.dist(there, east_north(*reversed(f["geometry"]["coordinates"][:2])))
                              for f in self.hazards if f["properties"]["class"] == report.class_name))
        self.assertGreater(len(errors), 3)
        errors.sort()
        self.assertLess(errors[len(errors) // 2], 1.5, errors)
        self.assertLess(errors[-1], 5.0, errors)

    def test_where_fusion_is_silent_the_fixes_count_and_it_says_so(self):
        vehicle = Vehicle("silent", self.folder, map_frame="elsewhere", fused_wait_s=0.3)
        self.addCleanup(vehicle.stop)
        vehicle.play(self.frames)
        eventually(lambda: int(vehicle.diagnostics().get("placed_by_fixes", 0)) > 5, "hazards by the fixes")
        eventually(lambda: "hazards placed by the fixes" in vehicle.output(), "the warning")
        self.assertEqual(vehicle.diagnostics()["placed_by_fusion"], "0")


if __name__ == "__main__":
    rospy.init_node("localized_vehicle_test")
    rostest.rosrun("livemap", "localized_vehicle", LocalizedVehicleTest, sys.argv)
