#!/usr/bin/python3
"""Whole demos, from the bag to the map, of drives whose images are raw, or both raw and compressed, under hard names."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test/support"))
from drive_bags import FRAME, stamp, with_header, write_drive  # noqa: E402
from livemap.msg import Detection, DetectionArray  # noqa: E402

FRAMES = 20


def boxes(seconds):
    """One sure pothole on the road ahead of every image."""
    one = Detection(class_name="pothole", confidence=0.9, x_min=140.0, y_min=140.0, x_max=180.0, y_max=160.0)
    return with_header(DetectionArray(model="labels", image_width=320, image_height=200, detections=[one]), seconds, FRAME)


class Demos(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_demo_bags_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def demo(self, bag):
        done = subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_demo"), "--headless", "--json", "--use-truth",
                               "--directory", str(self.folder / "kept here"), f"--bag={bag}"],
                              capture_output=True, text=True, timeout=400, cwd=self.folder, check=False)
        said = done.stderr + "".join(log.read_text(errors="replace")[-3000:]
                                     for log in (self.folder / "kept here").glob("vehicle.log"))
        return done.returncode, json.loads(done.stdout or "null"), said

    def test_raw_images_are_heard_also_beside_compressed_ones_and_counted_once(self):
        for name, images in (("-it's \"raw\" $HOME.bag", "raw"), ("b\u00f6th kinds.bag", "both")):
            with self.subTest(images):
                write_drive(self.folder / name, images=images, frames=FRAMES, replace={"/ground_truth/boxes": boxes})
                code, summary, said = self.demo(name)
                self.assertEqual(code, 0, said)
                self.assertEqual([summary["frames_of_drive"], summary["frames_in"]], [FRAMES, FRAMES])

    def test_a_drive_of_which_no_frame_could_be_used_ends_with_1_and_says_so(self):
        def no_picture(seconds):
            from sensor_msgs.msg import CompressedImage
            return with_header(CompressedImage(format="jpeg", data=b"this is no picture"), seconds, FRAME)
        write_drive(self.folder / "drive.bag", frames=FRAMES,
                    replace={"/ground_truth/boxes": boxes, "/camera/image_raw/compressed": no_picture})
        code, summary, said = self.demo("drive.bag")
        self.assertEqual(code, 1, said)
        self.assertEqual(summary["frames_of_drive"], FRAMES)
        self.assertIn("no frame of the drive was used", said)


if __name__ == "__main__":
    unittest.main()
