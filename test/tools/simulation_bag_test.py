#!/usr/bin/python3
"""The bag of a simulated drive, made as a user makes it."""
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np
import rosbag
import rostest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))

from node_testing import program  # noqa: E402

DRIVE = ["--seed", 3, "--seconds", 3, "--rate", 2, "--size", "160x120", "--one-ray",
         "--start", "50,8"]
METRES_PER_DEGREE = 111229  # of latitude at 50 degrees north
METRES_PER_DEGREE_EAST = 71696


def run(*arguments):
    return subprocess.run([program("livemap", "livemap_simulate"), *map(str, arguments)],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=300)


def messages(path, topic):
    with rosbag.Bag(path) as bag:
        return [message for _, message, _ in bag.read_messages(topic)]


def headers(stamped):
    return [(m.header.seq, m.header.stamp, m.header.frame_id) for m in stamped]


def read(path):
    with open(path, "rb") as file:
        return file.read()


class SimulationBagTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="livemap_simulation_")
        cls.bag = cls.path("drive.bag")
        cls.hazards = cls.path("drive.geojson")
        cls.arguments = [*DRIVE, "--bag-depth", "--stereo", 0.3, "--fix-noise-m", 0,
                         "--multipath-m", 0]
        result = run(*cls.arguments, "--bag", cls.bag, "--hazards", cls.hazards)
        assert result.returncode == 0, result.stderr

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    @classmethod
    def path(cls, name):
        return os.path.join(cls.folder, name)

    def test_same_command_same_bytes(self):
        again = self.path("again.bag")
        self.assertEqual(run(*self.arguments, "--bag", again).returncode, 0)
        self.assertEqual(read(self.bag), read(again))

    def refused(self, *arguments):
        result = run(*DRIVE, *arguments)
        self.assertEqual(result.returncode, 2)
        self.assertEqual(result.stderr.strip().count("\n"), 0, "one sentence, no frame rendered")
        return result.stderr

    def test_a_drive_that_nobody_would_see_is_refused(self):
        self.assertIn("nothing would be written: accepted is at least one of --preview", self.refused())

    def test_what_cannot_be_written_at_the_end_is_refused_at_the_start(self):
        for flag, name in (("--preview", "p.png"), ("--truth-preview", "p.png"), ("--hazards", "h.geojson")):
            path = self.path(os.path.join("nowhere", name))
            self.assertIn(f"'{path}' cannot be written", self.refused(flag, path))
        untouched = self.path("untouched.geojson")
        self.assertIn("must end in .png or .jpg", self.refused("--hazards", untouched, "--preview", "p.xyz"))
        self.assertFalse(os.path.exists(untouched))

    def test_wheel_twist_comes_at_fifty_hertz_and_agrees_with_the_truth(self):
        twists = messages(self.bag, "/wheel/twist")
        # 3 s of pictures, a second before and one after, both ends counted.
        self.assertEqual(len(twists), 5 * 50 + 1)
        self.assertEqual({twist.header.frame_id for twist in twists}, {"base_link"})
        steps = [(b.header.stamp - a.header.stamp).to_sec() for a, b in zip(twists, twists[1:])]
        np.testing.assert_allclose(steps, 0.02, atol=1e-8)
        by_stamp = {twist.header.stamp: twist.twist for twist in twists}
        for odom in messages(self.bag, "/ground_truth/odom"):
            measured = by_stamp[odom.header.stamp]
            true = odom.twist.twist
            self.assertAlmostEqual(measured.twist.linear.x, true.linear.x,
                                   delta=5 * math.sqrt(measured.covariance[0]))
            self.assertAlmostEqual(measured.twist.angular.z, true.angular.z,
                                   delta=5 * math.sqrt(measured.covariance[35]))
            known = [i for i, variance in enumerate(measured.covariance) if variance]
            self.assertEqual(known, [0, 35])

    def test_odometry_of_the_truth_is_where_the_true_fix_is(self):
        odometry = messages(self.bag, "/ground_truth/odom")
        self.assertEqual(len(odometry), 6)
        images = messages(self.bag, "/camera/image_raw/compressed")
        self.assertEqual([o.header.stamp for o in odometry], [i.header.stamp for i in images])
        fixes = {fix.header.stamp: fix for fix in messages(self.bag, "/ground_truth/fix")}
        for odom in odometry:
            self.assertEqual((odom.header.frame_id, odom.child_frame_id), ("map", "base_link"))
            fix = fixes[odom.header.stamp]
            position = odom.pose.pose.position
            self.assertAlmostEqual((fix.latitude - 50) * METRES_PER_DEGREE, position.y, delta=0.05)
            self.assertAlmostEqual((fix.longitude - 8) * METRES_PER_DEGREE_EAST, position.x,
                                   delta=0.05)

    def test_hazards_are_latched_before_the_first_picture_and_those_of_the_file(self):
        with rosbag.Bag(self.bag) as bag:
            order = [topic for topic, _, _ in bag.read_messages(
                ["/ground_truth/hazards", "/camera/image_raw/compressed"])]
            latching = [connection.header.get("latching", b"0")
                        for connection in bag._get_connections(["/ground_truth/hazards"])]
        self.assertEqual(order[0], "/ground_truth/hazards")
        self.assertEqual(order.count("/ground_truth/hazards"), 1)
        self.assertIn(latching[0], (b"1", "1"))
        text = messages(self.bag, "/ground_truth/hazards")[0].data
        self.assertEqual(text.encode(), read(self.hazards))
        self.assertTrue(json.loads(text)["features"])

    def test_depth_is_metres_with_nothing_in_the_sky(self):
        images = messages(self.bag, "/camera/depth/image_raw")
        infos = messages(self.bag, "/camera/depth/camera_info")
        pictures = messages(self.bag, "/camera/image_raw/compressed")
        self.assertEqual(headers(images), headers(pictures))
        self.assertEqual(headers(infos), headers(pictures))
        image = images[0]
        self.assertEqual((image.encoding, image.width, image.height), ("32FC1", 160, 120))
        depth = np.frombuffer(image.data, np.float32).reshape(120, 160)
        # The camera is 1.45 m over the road and looks down by 4 degrees.
        self.assertTrue(2 < depth[119, 80] < 4, depth[119, 80])
        self.assertTrue(np.isnan(depth).any())
        self.assertFalse((depth == 0).any())

    def test_right_eye_states_its_baseline_in_the_frame_of_the_left(self):
        lefts = messages(self.bag, "/camera/camera_info")
        rights = messages(self.bag, "/camera_right/camera_info")
        self.assertEqual(headers(rights), headers(lefts))
        self.assertAlmostEqual(rights[0].P[3], -0.3 * rights[0].K[0])
        self.assertEqual(lefts[0].P[3], 0)
        left = messages(self.bag, "/camera/image_raw/compressed")
        right = messages(self.bag, "/camera_right/image_raw/compressed")
        self.assertEqual(len(right), len(left))
        self.assertNotEqual(bytes(right[0].data), bytes(left[0].data))

    def test_receiver_flags_shape_the_fix(self):
        other = self.path("noisy.bag")
        result = run(*DRIVE, "--bag", other, "--fix-rate", 4, "--fix-noise-m", 2,
                     "--fix-dropouts-per-min", 600, "--fix-dropout-s", 0.5)
        self.assertEqual(result.returncode, 0, result.stderr)
        fixes = messages(other, "/fix")
        self.assertEqual(len(fixes), 5 * 4 + 1)
        self.assertTrue(any(fix.status.status < 0 for fix in fixes))
        self.assertTrue(any(fix.status.status >= 0 for fix in fixes))
        stated = [fix.position_covariance[0] for fix in fixes if fix.status.status >= 0]
        np.testing.assert_allclose(stated, 4)
        # Without noise and multipath the fix is the truth.
        for fix, truth in zip(messages(self.bag, "/fix"), messages(self.bag, "/ground_truth/fix")):
            self.assertAlmostEqual(fix.latitude, truth.latitude, places=9)

    def test_multipath_moves_the_fix_between_houses(self):
        other = self.path("street.bag")
        result = run(*DRIVE, "--bag", other, "--fix-noise-m", 0, "--multipath-m", 10)
        self.assertEqual(result.returncode, 0, result.stderr)
        errors = [
            math.hypot((fix.latitude - truth.latitude) * METRES_PER_DEGREE,
                       (fix.longitude - truth.longitude) * METRES_PER_DEGREE_EAST)
            for fix, truth in zip(messages(other, "/fix"), messages(other, "/ground_truth/fix"))]
        self.assertGreater(np.mean(errors), 1)
        # It changes slowly: 0.8 m of driving between two fixes.
        self.assertLess(np.max(np.abs(np.diff(errors))), 8)

    def test_jpeg_quality_sets_the_pictures_size(self):
        small = self.path("small.bag")
        self.assertEqual(run(*DRIVE, "--bag", small, "--jpeg-quality", 30).returncode, 0)
        coarse = messages(small, "/camera/image_raw/compressed")[0].data
        fine = messages(self.bag, "/camera/image_raw/compressed")[0].data
        self.assertLess(len(coarse), 0.6 * len(fine))
        self.assertIsNotNone(cv2.imdecode(np.frombuffer(coarse, np.uint8), cv2.IMREAD_COLOR))


if __name__ == "__main__":
    rostest.rosrun("livemap", "simulation_bag", SimulationBagTest)
