#!/usr/bin/python3
"""`livemap bench vo` as a person meets it, in its quick form: the page, its plots, the figures and the mistakes.

    bench_vo_test.py SCRIPT MEASURE_VO SIMULATE
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

SIMULATE, MEASURE, SCRIPT = sys.argv.pop(), sys.argv.pop(), sys.argv.pop()
PROGRAMS = os.pathsep.join(os.path.dirname(program) for program in (MEASURE, SIMULATE))
PLOTS = ("ablation", "basin", "pixels")


def run(program, *arguments):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=900, check=False)


class BenchVoTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.cache, cls.out = cls.folder / "cache", cls.folder / "out"
        # One's own sequence, as TUM packs it: neither associations nor camera, the name says which.
        cls.own = cls.folder / "rgbd_dataset_freiburg1_made_up"
        made = run(SIMULATE, "--wall", "--tum", cls.own, "--seconds", 0.3, "--rate", 10)
        assert made.returncode == 0, made.stderr
        (cls.own / "associations.txt").unlink()
        (cls.own / "camera.yaml").unlink()
        cls.done = run(SCRIPT, "--quick", "--out", cls.out, "--cache", cls.cache, "--programs", PROGRAMS,
                       "--sequence", cls.own)
        assert cls.done.returncode == 0, cls.done.stderr
        cls.page = (cls.out / "odometry.md").read_text(encoding="utf-8")
        cls.results = json.loads((cls.cache / "quick.json").read_text(encoding="utf-8"))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def section(self, title):
        found = re.search(rf"^##+ {re.escape(title)}\n(.*?)(?=^## |^### |\Z)", self.page, re.M | re.S)
        self.assertIsNotNone(found, title)
        return found.group(1)

    def rows(self, title):
        """The cells of a section's tables, without heads."""
        lines = [line for line in self.section(title).splitlines() if line.startswith("|")]
        return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "---" not in line]

    def test_the_page_has_every_table(self):
        names = ["wall", "room", self.own.name]
        self.assertEqual([row[0] for row in self.rows("Sequences")[1:]], names)
        for title in ("Relative pose error (m/s)", "Relative pose error (deg/s)", "Absolute trajectory error (m)"):
            head = self.rows(title)[0]
            for kind in ("canny", "log", "sobel"):
                for rule in ("KF", "K5", "FF"):
                    self.assertIn(f"{kind} {rule}", head)
            self.assertEqual(head[-2:], ["OpenCV RgbdOdometry", "OpenCV RgbdICPOdometry"])
        self.assertEqual([row[:2] for row in self.rows("Absolute trajectory error (m)")[1:]],
                         [[name, whose] for name in names for whose in ("keyframe's", "new image's")])
        self.assertEqual([row[0] for row in self.rows("Time")[1:]], names)
        self.assertEqual([row[0] for row in self.rows("Edge pixels against random pixels") if row[0].endswith("%")],
                         2 * ["5%", "10%", "20%", "40%", "70%", "100%"], "of the room and the own sequence")
        self.assertGreater(len(self.rows("Time against the number of pixels")), 20)
        self.assertEqual(sum(row[0] == "12 deg" for row in self.rows("Convergence basin")), 2)
        self.assertIn("quick run", self.page)

    def test_a_bar_that_holds_and_one_that_is_missed_are_told_apart(self):
        room = next(s for s in self.results["sequences"] if s["name"] == "room")
        default = room["tables"]["rows"][0]
        for row in self.rows("The bars")[1:]:
            if row[0] == "room" and row[1] == "ATE (m)":
                self.assertEqual(row[4], "holds" if default["ate_rmse_m"] <= 0.002 else "**missed**")
        by_hand = json.loads(json.dumps(self.results))
        next(s for s in by_hand["sequences"] if s["name"] == "room")["tables"]["rows"][0]["ate_rmse_m"] = 0.5
        results, out = self.folder / "worse.json", self.folder / "worse"
        results.write_text(json.dumps(by_hand), encoding="utf-8")
        self.assertEqual(run(SCRIPT, "--again", results, "--out", out).returncode, 0)
        self.assertIn("| room | ATE (m) | 0.002 | 0.5000 | **missed** |", (out / "odometry.md").read_text())

    def test_an_interrupted_run_is_taken_up_where_it_ended(self):
        figures = self.cache / "quick" / "figures"
        before = {file.name: file.stat().st_mtime_ns for file in figures.iterdir()}
        (figures / "room_basin.json").unlink()
        done = run(SCRIPT, "--quick", "--resume", "--out", self.out, "--cache", self.cache, "--programs", PROGRAMS,
                   "--sequence", self.own)
        self.assertEqual(done.returncode, 0, done.stderr)
        after = {file.name: file.stat().st_mtime_ns for file in figures.iterdir()}
        self.assertEqual([name for name in before if after[name] != before[name]], ["room_basin.json"])

    def test_a_quick_page_does_not_replace_the_published_one(self):
        tree = self.folder / "tree"
        published = tree / "docs" / "results" / "odometry.md"
        published.parent.mkdir(parents=True)
        published.write_text("published", encoding="utf-8")
        quick = tree / "build" / "vo_benchmark" / "quick" / "odometry.md"
        shutil.copytree(self.cache, tree / "build" / "vo_benchmark")
        done = run(SCRIPT, "--quick", "--resume", "--root", tree, "--programs", PROGRAMS, "--sequence", self.own)
        self.assertEqual((done.returncode, done.stdout.strip()), (0, str(quick)), done.stderr)
        self.assertEqual(quick.read_text(encoding="utf-8"), self.page)
        quick.unlink()
        again = run(SCRIPT, "--again", self.cache / "quick.json", "--root", tree)
        self.assertEqual((again.returncode, again.stdout.strip()), (0, str(quick)), again.stderr)
        self.assertEqual(published.read_text(encoding="utf-8"), "published")
        by_hand = {**self.results, "quick": False}
        (self.folder / "whole.json").write_text(json.dumps(by_hand), encoding="utf-8")
        whole = run(SCRIPT, "--again", self.folder / "whole.json", "--root", tree)
        self.assertEqual(whole.stdout.strip(), str(published), "a whole run is published")

    def test_two_sequences_of_one_name_are_refused(self):
        other = self.folder / "elsewhere" / "room"
        other.mkdir(parents=True)
        done = run(SCRIPT, "--quick", "--cache", self.cache, "--programs", PROGRAMS, "--sequence", other)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
        self.assertIn("'room'", done.stderr)

    def test_plots_that_the_page_shows_are_there_and_small(self):
        shown = re.findall(r"!\[[^]]+\]\(([^)]+)\)", self.page)
        self.assertEqual(sorted(shown), [f"odometry_{name}.png" for name in PLOTS])
        for name in shown:
            data = (self.out / name).read_bytes()
            self.assertEqual(data[:4], b"\x89PNG")
            self.assertLess(len(data), 300_000)

    def test_results_hold_every_method_with_time_and_errors(self):
        self.assertEqual(set(self.results["machine"]), {"cpu", "cores"})
        for sequence in self.results["sequences"]:
            rows = sequence["tables"]["rows"]
            self.assertEqual(len(rows), 3 * 3 * 2 + 2)
            self.assertEqual({row["method"] for row in rows}, {"edge", "rgbd", "rgbd-icp"})
            for row in rows:
                self.assertGreater(row["median_ms"], 0)
                self.assertGreaterEqual(row["p95_ms"], row["median_ms"])
                self.assertIsNotNone(row["ate_rmse_m"])
                self.assertEqual(row["lost"], 0)
        wall = self.results["sequences"][0]["tables"]["rows"][0]
        self.assertLess(wall["ate_rmse_m"], 0.001)

    def test_random_pixels_are_as_many_as_edge_pixels(self):
        room = next(s for s in self.results["sequences"] if s["name"] == "room")
        rows = room["ablation"]["rows"]
        for share in (0.1, 0.4):
            points = [row["points"] for row in rows if row["share"] == share]
            self.assertEqual(len(points), 4)
            self.assertLess(max(points) - min(points), 0.1 * max(points), "but for other keyframes")

    def test_small_errors_of_the_guess_converge_and_large_ones_do_not(self):
        room = next(s for s in self.results["sequences"] if s["name"] == "room")
        rows = {(row["translation_m"], row["rotation_deg"]): row for row in room["basin"]["rows"]}
        self.assertEqual(rows[(0.02, 0)]["edge"], 1)
        self.assertLess(rows[(0.4, 0)]["edge"], 1)

    def test_mistakes_are_refused_in_one_sentence(self):
        for flag, value in (("--sequence", "/nowhere"), ("--camera", "/nowhere"), ("--again", "/nowhere"),
                            ("--edge-model", "/nowhere")):
            done = run(SCRIPT, flag, value)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(flag, done.stderr)
        for flag in ("--fast", "--qui"):
            done = run(SCRIPT, flag)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(flag, done.stderr)
        empty = self.folder / "empty.json"
        empty.write_text("{}", encoding="utf-8")
        done = run(SCRIPT, "--again", empty)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
        done = run(MEASURE, "speed", self.own)
        self.assertEqual(done.returncode, 2)
        self.assertIn("tables, ablation, pixels, basin, world", done.stderr)
        done = run(MEASURE, "tables", "/nowhere")
        self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1))
        done = run(MEASURE, "tables", self.own, "--edge-model", "/nowhere")
        self.assertEqual(done.returncode, 2)

    def test_rooms_of_boxes_are_followed_and_told_in_a_table(self):
        done = run(SCRIPT, "--quick", "--worlds", "boxes", "--cache", self.cache, "--programs", PROGRAMS)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = [line for line in done.stdout.splitlines() if line.startswith("|")][2:]
        self.assertEqual([row.split("|")[1].strip() for row in rows],
                         ["speed 1", "speed 4", "every 4th frame", "depth with noise", "speed 4 at 10 Hz"])
        results = json.loads((self.cache / "worlds_boxes.json").read_text(encoding="utf-8"))
        for row in results["rows"]:
            self.assertEqual([room["seed"] for room in row["each"]], [row["first_seed"], row["first_seed"] + 2])
            self.assertEqual(row["frames"], 2 * 4)
            for room in row["each"]:
                self.assertEqual(room["false"], room["lost"] > 0 or room["worst_step_m"] > 0.02)
        slow = results["rows"][0]["each"]
        self.assertLess(min(room["ate_rmse_m"] for room in slow), 0.003)
        self.assertGreater(min(room["ate_rmse_m"] for room in slow), 0, "noise is drawn")

    def test_help_names_every_flag(self):
        done = run(SCRIPT, "--help")
        self.assertEqual(done.returncode, 0)
        for flag in ("--sequence", "--camera", "--edge-model", "--quick", "--resume", "--again", "--out", "--cache",
                     "--data"):
            self.assertIn(flag, done.stdout)


if __name__ == "__main__":
    unittest.main()
