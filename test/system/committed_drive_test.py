#!/usr/bin/python3
"""The committed drive is what the command in rosbags/README.md makes, and no larger than it may be."""

import filecmp
import json
import pathlib
import shlex
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np
import rosbag

ROOT = pathlib.Path(__file__).resolve().parents[2]
ROSBAGS = ROOT / "rosbags"
MOST_BYTES = 8_000_000
MOST_GREY_LEVELS = 1.0
MOST_BOX_PX = 2.0
PICTURES, BOXES = "/camera/image_raw/compressed", "/ground_truth/boxes"


def written_command():
    """Arguments of the README's `./livemap simulate` line that writes town.bag."""
    text = (ROSBAGS / "README.md").read_text().replace("\\\n", " ")
    line, = [line for line in text.splitlines() if "livemap simulate" in line and "town.bag" in line]
    return shlex.split(line.strip().strip("`"))[2:]


def messages(bag, topic):
    return [message for _, message, _ in bag.read_messages(topic)]


def picture(message):
    return cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR).astype(float)


def boxes(message):
    return {(d.class_name, i): np.array([d.x_min, d.y_min, d.x_max, d.y_max])
            for i, d in enumerate(message.detections)}


class CommittedDrive(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="livemap-town-")
        made = pathlib.Path(cls.folder.name)
        arguments = [str(made / pathlib.Path(a).name) if a.endswith((".bag", ".geojson")) else str(ROOT / a)
                     if a.startswith("rosbags/") else a for a in written_command()]
        subprocess.run([PROGRAM, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        cls.made, cls.committed = made / "town.bag", ROSBAGS / "town.bag"

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_bag_is_small_enough_to_be_committed(self):
        self.assertLessEqual(self.committed.stat().st_size, MOST_BYTES)

    def test_the_true_hazards_are_those_of_the_command(self):
        made, committed = (json.loads(path.with_suffix(".geojson").read_text())["features"]
                           for path in (self.made, self.committed))
        self.assertEqual([f["properties"]["class"] for f in made], [f["properties"]["class"] for f in committed])
        for one, other in zip(made, committed):
            np.testing.assert_allclose(one["geometry"]["coordinates"], other["geometry"]["coordinates"], atol=1e-8)
            self.assertAlmostEqual(one["properties"]["frames_seen"], other["properties"]["frames_seen"], delta=2)

    def test_the_command_writes_the_committed_bag(self):
        """Byte for byte; on another kind of processor, whose last bits differ, the same but for those."""
        if filecmp.cmp(self.made, self.committed, shallow=False):
            return
        print("the bytes differ, as on another kind of processor; comparing what they mean", file=sys.stderr)
        with rosbag.Bag(str(self.made)) as made, rosbag.Bag(str(self.committed)) as committed:
            counts = [{name: info.message_count for name, info in bag.get_type_and_topic_info().topics.items()}
                      for bag in (made, committed)]
            self.assertEqual(*counts)
            for one, other in zip(messages(made, PICTURES), messages(committed, PICTURES)):
                self.assertEqual(one.header.stamp, other.header.stamp)
                self.assertLess(np.abs(picture(one) - picture(other)).mean(), MOST_GREY_LEVELS)
            for one, other in zip(messages(made, BOXES), messages(committed, BOXES)):
                first, second = boxes(one), boxes(other)
                self.assertEqual(first.keys(), second.keys())
                for key, box in first.items():
                    self.assertLess(np.abs(box - second[key]).max(), MOST_BOX_PX)


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main()
