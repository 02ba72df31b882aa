#!/usr/bin/python3
"""livemap_evaluate_localization as a person meets it, on a made-up drive eastwards along the equator.

    evaluate_localization_test.py EVALUATE_LOCALIZATION
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop()
RADIUS_M = 6378137.0
SPEED_MPS = 10.0
SECONDS = 12


def write_drive(folder):
    """Fixes at 10 Hz as exact as the table's digits, poses and wheel speed at 20 Hz."""
    half_turn = math.sqrt(0.5)
    with open(os.path.join(folder, "gnss_ublox.csv"), "w", encoding="ascii") as file:
        file.write("t_s,lat_deg,lon_deg\n")
        for i in range(10 * SECONDS + 1):
            file.write(f"{100 + i / 10},0,{math.degrees(SPEED_MPS * i / 10 / RADIUS_M):.10f}\n")
    with open(os.path.join(folder, "pose.csv"), "w", encoding="ascii") as poses, \
            open(os.path.join(folder, "can_speed.csv"), "w", encoding="ascii") as speeds:
        poses.write("t_s,ecef_x_m,ecef_y_m,ecef_z_m,q_w,q_x,q_y,q_z\n")
        speeds.write("t_s,speed_mps\n")
        for i in range(20 * SECONDS + 1):
            angle = SPEED_MPS * i / 20 / RADIUS_M
            x, y = RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle)
            poses.write(f"{100 + i / 20},{x:.6f},{y:.6f},0,{half_turn},0,0,{half_turn}\n")
            speeds.write(f"{100 + i / 20},{SPEED_MPS}\n")


class EvaluateLocalizationTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.drive = cls.temporary.name
        write_drive(cls.drive)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def run_on_drive(self, flags):
        return subprocess.run([PROGRAM, *flags.split(), self.drive], capture_output=True, text=True, timeout=120,
                              check=False)

    def figures(self, flags):
        done = self.run_on_drive("--json --latency-s 0 " + flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_flags_have_the_effect_they_name(self):
        figures = self.figures("")
        self.assertEqual((figures["fixes"], figures["outliers_added"]), (121, 0))
        self.assertLess(figures["fused_rmse_m"], 0.5)
        self.assertIsNone(figures["dropout_error_m"])
        self.assertIsNotNone(self.figures("--dropout-s 6,3")["dropout_error_m"])
        self.assertEqual(self.figures("--dropout-s 6,3")["fixes"], 121 - 30)
        near, far = (self.figures(f"--outliers 0.2 --outlier-m {metres}") for metres in (10, 100))
        self.assertEqual(near["outliers_added"], far["outliers_added"])
        self.assertGreater(far["fix_rmse_m"], 5 * near["fix_rmse_m"])
        hidden, told = self.figures("--noise-m 3 --hide-noise"), self.figures("--noise-m 3")
        self.assertNotEqual(hidden["nees_mean"], told["nees_mean"])

    def test_where_nothing_is_fused_the_figures_are_null_with_a_reason_and_exit_1(self):
        with tempfile.TemporaryDirectory() as folder:
            write_drive(folder)
            path = os.path.join(folder, "gnss_ublox.csv")
            with open(path, encoding="ascii") as file:
                head, *rows = file.read().splitlines()
            with open(path, "w", encoding="ascii") as file:
                # All fixes come after the last true pose.
                file.write("\n".join([head, *(f"{float(row.split(',')[0]) + 500},{row.split(',', 1)[1]}" for row in rows)]))
            done = subprocess.run([PROGRAM, "--json", folder], capture_output=True, text=True, timeout=120, check=False)
        self.assertEqual(done.returncode, 1, done.stderr)
        figures = json.loads(done.stdout)
        self.assertEqual(figures["n"], 0)
        for key in ("fix_rmse_m", "fused_rmse_m", "fused_p50_m", "fused_p95_m", "fused_max_m", "first_fused_s", "nees_mean"):
            self.assertIsNone(figures[key], key)
        self.assertIn("no true pose has a fused one", figures["reason"])
        self.assertIn("the fixes reach from 600.000 to 612.000 s, the true poses from 100.000 to 112.000 s", figures["reason"])
        self.assertIn(figures["reason"], done.stderr)

    def test_a_gap_in_the_recording_is_told(self):
        with tempfile.TemporaryDirectory() as folder:
            write_drive(folder)
            path = os.path.join(folder, "can_speed.csv")
            with open(path, encoding="ascii") as file:
                head, *rows = file.read().splitlines()
            with open(path, "w", encoding="ascii") as file:
                file.write("\n".join([head, *(row for row in rows if not 104 < float(row.split(",")[0]) < 108)]))
            done = subprocess.run([PROGRAM, "--json", folder], capture_output=True, text=True, timeout=120, check=False)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (0, 1), done.stderr)
        self.assertIn("the wheel speed with a true heading has a gap", done.stderr)
        self.assertEqual((json.loads(done.stdout)["odometry_gaps"], json.loads(done.stdout)["truth_gaps"]), (1, 0))

    def test_flags_that_would_change_nothing_are_refused(self):
        for flags, words in (("--outlier-m 5", "--outlier-m needs --outliers"),
                             ("--hide-noise", "--hide-noise needs --noise-m"),
                             ("--dropout-s 500,10", "its last one comes 12 s after the first"),
                             ("--dropout-s 2.02,0.05", "has no fix"),
                             ("--dropout-s 500", "START,LENGTH"),
                             ("--seed 1.5", "accepted is a whole number")):
            with self.subTest(flags):
                done = self.run_on_drive(flags)
                self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
                self.assertIn(words, done.stderr)


if __name__ == "__main__":
    unittest.main()
