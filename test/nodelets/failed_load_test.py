#!/usr/bin/python3
"""A nodelet with a wrong parameter fails to load with one sentence, and harms neither the manager nor its neighbours:
every nodelet with every parameter wrong, in one manager, beside others that go on publishing."""

import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy
import rospy
import rostest
from sensor_msgs.msg import Image

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import SOURCE_DIRECTORY, eventually  # noqa: E402
from nodelet_manager import NodeletManager  # noqa: E402

MODELS = pathlib.Path(SOURCE_DIRECTORY) / "models"
CALIBRATION = """image_width: {width}
image_height: {height}
camera_name: camera_optical_frame
camera_matrix: {{rows: 3, cols: 3, data: {k}}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: {d_count}, data: {d}}}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix: {{rows: 3, cols: 4, data: [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]}}
"""
GOOD_K = [60, 0, 32, 0, 60, 24, 0, 0, 1]
# What any text may stand for, but a program must be able to read: a path that is none.
FILES = {
    "camera_ingest": ["uri", "camera_info_url"],
    "hazard_detection": ["model", "privacy_networks", "privacy_cascades", "privacy_face_model"],
    "early_discard": ["model", "privacy_networks", "privacy_cascades", "privacy_face_model"],
    "change_detection": ["model", "directory"],
    "hazard_reporting": ["catalogue", "database"], "mqtt_bridge": ["password_file"]}
# Read by libraries and not by us.
FOREIGN = {"image_transport"}


def described():
    folder = subprocess.run(["catkin_find", "--first-only", "--libexec", "livemap"], stdout=subprocess.PIPE, check=True)
    program = os.path.join(folder.stdout.decode().strip(), "livemap_node_parameters")
    nodes = json.loads(subprocess.run([program, SOURCE_DIRECTORY], stdout=subprocess.PIPE, check=True).stdout)
    return {each["name"]: each for each in nodes if each["node"] != "zone_cloudlet"}


def wrong_values(parameter):
    """Values that no reader may accept for a parameter of this type and range."""
    if parameter["name"] in FOREIGN:
        return []
    kind = parameter["type"]
    wrong = [[1, 2]] if kind != "list" else [7]
    if kind in ("number", "integer"):
        wrong += ["a word", math.nan, math.inf]
        if "range" in parameter:
            least, most = parameter["range"]
            wrong += [least - 1 - abs(least), most + 1 + abs(most)]
    elif kind == "text":
        wrong += [True] + (["no such word"] if parameter["choices"] else [])
    elif kind == "boolean":
        wrong += ["a word", 7]
    else:
        wrong += ["a word"]
    # What XML-RPC cannot carry as a whole number is a number.
    return [float(each) if isinstance(each, int) and abs(each) > 2**31 - 1 else each for each in wrong]


class FailedLoadTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.images = cls.path / "images"
        cls.images.mkdir()
        for i in range(3):
            cv2.imwrite(str(cls.images / f"{i}.png"), numpy.full((48, 64, 3), 60 * i, numpy.uint8))
        cls.manager = NodeletManager()
        cls.nodes = described()
        cls.count = 0
        cls.seen = []
        # The neighbours that must live: one that publishes all the time, and one of each kind that needs no model.
        assert cls.load("neighbour", "camera_ingest", cls.folder_parameters())
        assert cls.load("neighbour_localization", "geo_localization", {})
        assert cls.load("neighbour_vo", "edge_vo", {})
        rospy.Subscriber("/camera_rect/image", Image, lambda message: cls.seen.append(message.header.stamp))

    @classmethod
    def tearDownClass(cls):
        cls.manager.stop()
        cls.folder.cleanup()

    @classmethod
    def folder_parameters(cls, calibration=None):
        return {"source": "folder", "uri": str(cls.images), "at_end": "loop", "rate_hz": 20.0,
                "camera_info_url": "file://" + str(calibration or cls.calibration())}

    @classmethod
    def calibration(cls, k=GOOD_K, d=(0, 0, 0, 0, 0), width=64, height=48):
        cls.count += 1
        path = cls.path / f"camera{cls.count}.yaml"
        path.write_text(CALIBRATION.format(k=list(k), d=list(d), d_count=len(d), width=width, height=height),
                        encoding="utf-8")
        return path

    @classmethod
    def load(cls, name, node, parameters):
        # Topics of its own for what is under test: only the neighbour writes the neighbour's.
        own = [] if name.startswith("neighbour") else ["/camera_rect/image", "/camera_rect/camera_info"]
        return cls.manager.load(name, node, parameters, {topic: f"/tested{topic}" for topic in own})

    def valid(self, name):
        """Parameters with which the node of this name loads."""
        node = self.nodes[name]["node"]
        database = str(self.path / f"{name}.sqlite3")
        given = {each["name"]: each["given"] for each in self.nodes[name]["parameters"] if "given" in each}
        if node == "camera_ingest":
            return self.folder_parameters()
        if node == "mqtt_bridge":
            return dict(given, zone="demo", user=given.get("user", "car-1"), port=1, password_wait_s=0.0, topics=[{
                "name": "report", "ros_topic": "hazard/report", "type": "livemap/HazardReport",
                "direction": "out", "mqtt_topic": "livemap/v1/{zone}/vehicle/{vehicle}/report"}])
        return {"hazard_detection": {"model": str(MODELS / "hazards-base.yaml")},
                "early_discard": {"model": str(MODELS / "early-discard.yaml")},
                "change_detection": {"method": "daisy", "directory": str(self.path / "places")},
                "hazard_reporting": {"database": database}}.get(node, {})

    def assert_all_live(self):
        self.assertTrue(self.manager.is_alive(), "the manager has died:\n" + self.manager.output()[-3000:])
        names = self.manager.names()
        self.assertLessEqual({"/neighbour", "/neighbour_localization", "/neighbour_vo"}, names)
        seen = len(self.seen)
        eventually(lambda: len(self.seen) > seen, "the neighbour publishes")

    def assert_refused(self, node, parameters, what, named=None):
        """`named`: what the one sentence must name."""
        before = len(self.manager.output())
        loaded = self.load("tested", node, parameters)
        if loaded:
            self.manager.unload("tested")
        self.assertFalse(loaded, f"{node} took {what}")
        self.assertTrue(self.manager.is_alive(),
                        f"{node} with {what} killed the manager:\n" + self.manager.output()[-3000:])

        def sentences():
            return [line for line in self.manager.output()[before:].splitlines() if "[FATAL]" in line]

        lines = eventually(sentences, f"{node} says why it refuses {what}")
        self.assertEqual(len(lines), 1, f"{node} with {what}: {lines}")
        self.assertIn("/tested: ", lines[0])
        for word in named or []:
            self.assertIn(word, lines[0], f"{node} with {what}")

    def test_every_parameter_of_the_wrong_type_or_out_of_range_is_a_failed_load_and_nothing_else(self):
        tried = 0
        for name, described_node in self.nodes.items():
            valid = self.valid(name)
            for parameter in described_node["parameters"]:
                key = parameter["name"]
                for wrong in wrong_values(parameter):
                    self.assert_refused(described_node["node"], dict(valid, **{key: wrong}), f"{key}: {wrong!r}", [key])
                    tried += 1
            self.assert_refused(described_node["node"], dict(valid, no_such_parameter=1), "an unknown parameter",
                                ["no_such_parameter"])
            self.assert_all_live()
        self.assertGreater(tried, 1000)

    def test_a_file_that_cannot_be_read_is_a_failed_load_and_nothing_else(self):
        torn = self.path / "torn"
        torn.write_bytes(bytes(range(256)) * 20)
        for name, described_node in self.nodes.items():
            node = described_node["node"]
            for key in FILES.get(node, []):
                for path in ("/proc/nothing/here", str(torn)):
                    if path == str(torn) and key in ("password_file", "database"):
                        continue  # A password is any line, a torn database is set aside.
                    valid = self.valid(name)
                    if key == "model" and node == "change_detection":
                        valid["method"] = "network"
                    if key == "privacy_cascades":  # Where networks are placed nobody reads them.
                        valid["privacy_finder"] = "cascades"
                    value = "file://" + path if key == "camera_info_url" else path
                    self.assert_refused(node, dict(valid, **{key: value}), f"{key}: {value}")
            self.assert_all_live()

    def test_a_calibration_that_cannot_be_is_refused_by_file_and_value(self):
        for what, arguments, named in (
                ("K of zeros", {"k": [0] * 9}, "K is"),
                ("a negative focal length", {"k": [-60, 0, 32, 0, 60, 24, 0, 0, 1]}, "-60"),
                ("NaN", {"k": [".nan", 0, 32, 0, 60, 24, 0, 0, 1]}, "nan"),
                ("NaN in the distortion", {"d": [".nan", 0, 0, 0, 0]}, "distortion"),
                ("three coefficients", {"d": [0.1, 0, 0]}, "3 distortion coefficients"),
                ("another size", {"width": 640, "height": 480}, "64x48"),
                ("no size", {"width": 0, "height": 0}, "0x0")):
            path = self.calibration(**{key: [str(each) for each in value] if isinstance(value, list) else value
                                       for key, value in arguments.items()})
            path.write_text(path.read_text(encoding="utf-8").replace("'", ""), encoding="utf-8")
            self.assert_refused("camera_ingest", self.folder_parameters(path), what, [str(path), named])
        self.assert_all_live()

    def test_a_nodelet_that_was_refused_loads_once_its_parameter_is_right(self):
        for name, described_node in self.nodes.items():
            node = described_node["node"]
            valid = self.valid(name)
            self.assert_refused(node, dict(valid, no_such_parameter=1), "an unknown parameter")
            self.assertTrue(self.load("tested", node, valid), node)
            self.assertTrue(self.manager.unload("tested"))
        self.assert_all_live()

    def test_nodelets_that_are_busy_can_be_unloaded(self):
        for _ in range(10):
            self.assertTrue(self.load("tested", "camera_ingest", dict(self.folder_parameters(), rate_hz=1000.0)))
            self.assertTrue(self.manager.unload("tested"))
        self.assert_all_live()


if __name__ == "__main__":
    rospy.init_node("failed_load_test", anonymous=True)
    rostest.rosrun("livemap", "failed_load", FailedLoadTest)
