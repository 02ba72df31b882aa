#!/usr/bin/python3
"""livemap_evaluate_trajectory as a person meets it.

    evaluate_trajectory_test.py PROGRAM
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop()


def run(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=60,
                          check=False)


class EvaluateTrajectoryTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name
        self.truth = self.write("truth.txt", 1.0)
        self.drifting = self.write("drifting.txt", 1.05)

    def write(self, name, speed):
        """A curve of 150 m in 10 poses per second."""
        lines = ["# stamp tx ty tz qx qy qz qw"]
        for i in range(1501):
            t = 0.1 * i
            lines.append(f"{1000 + t:.6f} {speed * t:.9f} {speed * 5 * math.sin(0.05 * t):.9f} 0 0 0 0 1")
        return self.write_text(name, "\n".join(lines) + "\n")

    def write_text(self, name, text):
        path = os.path.join(self.folder, name)
        with open(path, "w", encoding="ascii") as file:
            file.write(text)
        return path

    def figures(self, *arguments):
        done = run("--json", *arguments)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(done.stdout.count("\n"), 1)
        return json.loads(done.stdout)

    def test_the_truth_against_itself_has_no_error(self):
        figures = self.figures(self.truth, self.truth)
        self.assertEqual((figures["pairs"], figures["alignment"]), (1501, "se3"))
        self.assertNotIn("scale", figures)
        for key in ("ate_rmse_m", "ate_mean_m", "ate_median_m", "ate_max_m", "rpe_rmse_m_per_s",
                    "rpe_median_m_per_s", "rpe_rmse_deg_per_s", "rpe_median_deg_per_s",
                    "kitti_translation_percent", "kitti_rotation_deg_per_100m"):
            self.assertAlmostEqual(figures[key], 0, places=6, msg=key)
        self.assertAlmostEqual(figures["duration_s"], 150)
        self.assertGreater(figures["length_m"], 150)

    def test_a_scale_is_found_when_asked_for(self):
        self.assertGreater(self.figures(self.truth, self.drifting)["ate_rmse_m"], 1)
        for flags in (["--scale"], ["--align", "sim3"], ["--align=sim3", "--scale"]):
            figures = self.figures(*flags, self.truth, self.drifting)
            self.assertAlmostEqual(figures["scale"], 1 / 1.05)
            self.assertAlmostEqual(figures["ate_max_m"], 0, places=6)

    def test_flags_change_what_is_measured(self):
        self.assertEqual(self.figures("--offset", "-0.1", self.truth, self.truth)["pairs"], 1500)
        figures = self.figures("--delta-frames", "10", "--delta", "2", "--align", "none",
                               self.truth, self.drifting)
        self.assertEqual((figures["rpe_frames_delta"], figures["rpe_delta_s"]), (10, 2))
        self.assertGreater(figures["rpe_frames_rmse_m"], 0.04)
        self.assertEqual(figures["rpe_frames_rmse_deg"], 0)

    def test_kitti_files_take_their_time_from_the_rate(self):
        rows = "".join(f"1 0 0 {i} 0 1 0 {i % 3} 0 0 1 0\n" for i in range(50))
        poses = self.write_text("poses.txt", rows)
        self.assertAlmostEqual(self.figures(poses, poses)["duration_s"], 4.9)
        self.assertAlmostEqual(self.figures("--rate", "20", poses, poses)["duration_s"], 2.45)

    def test_without_json_it_is_a_table(self):
        done = run("--scale", "--delta-frames", "1", self.truth, self.drifting)
        self.assertEqual(done.returncode, 0, done.stderr)
        for words in ("1501 pairs", "scale 0.952381", "ATE (m)", "RPE over 1 s (deg/s)",
                      "RPE over 1 frame (m)", "KITTI segments: "):
            self.assertIn(words, done.stdout)

    def test_mistakes_are_one_sentence_and_exit_2(self):
        cut = self.write_text("cut.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0\n")
        far = self.write_text("far.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
        for arguments, expected in [
                ([], "got 0 arguments"), ([self.truth], "got 1 arguments"),
                (["--bogus", self.truth, self.truth], "--bogus"),
                (["/nowhere", self.truth], "/nowhere"), ([self.truth, self.folder], self.folder),
                ([self.truth, cut], "line 2 of '" + cut), ([self.truth, far], "0 of the 2"),
                (["--align", "best", self.truth, self.truth], "none, se3, sim3 and origin"),
                (["--align", "se3", "--scale", self.truth, self.truth], "--scale"),
                (["--delta", "0", self.truth, self.truth], "--delta"),
                (["--delta-frames", "1.5", self.truth, self.truth], "whole number"),
                (["--max-difference", "nan", self.truth, self.truth], "nan"),
                (["--rate", "-1", self.truth, self.truth], "--rate")]:
            done = run(*arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertEqual(done.stdout, "", arguments)
            self.assertEqual(done.stderr.strip().count("\n"), 0, done.stderr)
            self.assertIn(expected, done.stderr)

    def test_it_has_help(self):
        done = run("--help")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("usage: livemap_evaluate_trajectory", done.stdout)


if __name__ == "__main__":
    unittest.main()
