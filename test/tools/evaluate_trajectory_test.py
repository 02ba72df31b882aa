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

    def test_kitti_files_of_different_lengths_are_told(self):
        rows = [f"1 0 0 {i} 0 1 0 {i % 3} 0 0 1 0\n" for i in range(50)]
        whole, short = self.write_text("whole.txt", "".join(rows)), self.write_text("short.txt", "".join(rows[3:]))
        self.assertIs(self.figures(whole, whole)["unequal_lengths"], False)
        done = run("--json", whole, short)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (0, 1), done.stderr)
        self.assertIs(json.loads(done.stdout)["unequal_lengths"], True)
        for words in (whole, "50 poses", short, "47", "line by line"):
            self.assertIn(words, done.stderr)

    def test_without_json_it_is_a_table(self):
        done = run("--scale", "--delta-frames", "1", self.truth, self.drifting)
        self.assertEqual(done.returncode, 0, done.stderr)
        for words in ("1501 pairs", "scale 0.952381", "ATE (m)", "RPE over 1 s (deg/s)",
                      "RPE over 1 frame (m)", "KITTI segments: "):
            self.assertIn(words, done.stdout)

    def test_mistakes_are_one_sentence_and_exit_2(self):
        cut = self.write_text("cut.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0\n")
        still = self.write("still.txt", 0.0)
        comma = self.write_text("comma.txt", "1,0,0,0,0,0,0,1\n")
        nanoseconds = self.write_text("euroc.txt", "1403636579763555584 0 0 0 0 0 0 1\n")
        for arguments, expected in [
                ([], "got 0 arguments"), ([self.truth], "got 1 arguments"),
                (["--bogus", self.truth, self.truth], "--bogus"),
                (["--align", "sim3", still, self.truth], "the truth does not move"),
                (["--align", "sim3", self.truth, still], "the estimate does not move"),
                ([self.truth, comma], "separated by ','"),
                ([self.truth, nanoseconds], "looks like nanoseconds"),
                (["/nowhere", self.truth], "/nowhere"), ([self.truth, self.folder], self.folder),
                ([self.truth, cut], "line 2 of '" + cut),
                (["--align", "best", self.truth, self.truth], "none, se3, sim3 and origin"),
                (["--align", "se3", "--scale", self.truth, self.truth], "--scale"),
                (["--delta", "0", self.truth, self.truth], "--delta"),
                (["--delta-frames", "1.5", self.truth, self.truth], "whole number"),
                (["--max-difference", "nan", self.truth, self.truth], "nan"),
                (["--align=", self.truth, self.truth], "--align is '', accepted is KIND"),
                (["--align", "", self.truth, self.truth], "--align is ''"),
                (["--align", "--json", self.truth, self.truth], "'--align' needs a value: KIND"),
                (["--align", "--rate=5", self.truth, self.truth], "'--align' needs a value: KIND"),
                (["--rate", "-1", self.truth, self.truth], "--rate")]:
            done = run(*arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertEqual(done.stdout, "", arguments)
            self.assertEqual(done.stderr.strip().count("\n"), 0, done.stderr)
            self.assertIn(expected, done.stderr)

    def test_what_shares_no_time_is_null_with_a_reason_and_exit_1(self):
        far = self.write_text("far.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
        one = self.write_text("one.txt", "1000 0 0 0 0 0 0 1\n")
        for estimate, words in ((far, "0 of the 2"), (one, "1 of the 1")):
            done = run("--json", self.truth, estimate)
            self.assertEqual((done.returncode, done.stderr.strip().count("\n")), (1, 0), done.stderr)
            figures = json.loads(done.stdout)
            self.assertIn(words, figures["reason"])
            self.assertIn(figures["reason"], done.stderr)
            self.assertEqual((figures["truth_poses"], figures["ate_rmse_m"], figures["rpe_rmse_m_per_s"]),
                             (1501, None, None))
            done = run(self.truth, estimate)
            self.assertEqual((done.returncode, done.stdout), (1, ""))
            self.assertIn(words, done.stderr)

    def test_a_pose_that_is_said_twice_is_taken_once_with_a_note(self):
        with open(self.truth, encoding="ascii") as file:
            lines = file.read().splitlines()
        twice = self.write_text("twice.txt", "\n".join([*lines[:5], lines[4], *lines[5:]]) + "\n")
        done = run("--json", twice, self.truth)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["pairs"], 1501)
        self.assertIn(f"1 line of '{twice}', the first of them line 6", done.stderr)
        stamp = lines[4].split()[0]
        torn = self.write_text("torn.txt", "\n".join([*lines[:5], stamp + " 99 0 0 0 0 0 1", *lines[5:]]))
        done = run(torn, self.truth)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("lines 5 and 6", done.stderr)

    def test_marks_and_line_ends_of_other_systems_do_not_count(self):
        with open(self.truth, "rb") as file:
            stored = file.read()
        for name, text in (("marked", b"\xef\xbb\xbf" + stored), ("windows", stored.replace(b"\n", b" \r\n")),
                           ("mac", stored.replace(b"\n", b"\r")), ("cut", stored[:-1] + b"\n\n\n")):
            path = os.path.join(self.folder, name)
            with open(path, "wb") as file:
                file.write(text)
            self.assertEqual(self.figures(path, self.truth)["pairs"], 1501, name)
        path = os.path.join(self.folder, "wide")
        with open(path, "wb") as file:
            file.write(stored.decode("ascii").encode("utf-16"))
        done = run(path, self.truth)
        self.assertEqual(done.returncode, 2)
        self.assertIn("byte order mark of UTF-16", done.stderr)

    def test_it_has_help(self):
        done = run("--help")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("usage: livemap_evaluate_trajectory", done.stdout)


if __name__ == "__main__":
    unittest.main()
