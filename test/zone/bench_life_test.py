#!/usr/bin/python3
"""`livemap bench life` as a person meets it, in its quick form: the page, its plot, the figures and the mistakes.

    bench_life_test.py SCRIPT MEASURE_LIFE
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

MEASURE, SCRIPT = sys.argv.pop(), sys.argv.pop()
ROOT = pathlib.Path(SCRIPT).resolve().parent.parent


def run(program, *arguments):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=900, check=False)


class BenchLifeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.done = run(SCRIPT, "--quick", "--out", cls.folder / "out", "--cache", cls.folder / "cache", "--root", ROOT,
                       "--programs", os.path.dirname(MEASURE))
        assert cls.done.returncode == 0, cls.done.stderr
        cls.page = (cls.folder / "out/zone_life.md").read_text(encoding="utf-8")
        cls.runs = json.loads((cls.folder / "cache/quick.json").read_text(encoding="utf-8"))["runs"]

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def figures(self, study, rule, value, seed=1):
        found = [run["figures"] for run in self.runs
                 if (run["study"], run["rule"], run["value"], run["seed"]) == (study, rule, value, seed)]
        self.assertEqual(len(found), 1)
        return found[0]

    def test_the_page_has_every_class_rule_and_share(self):
        for text in ("| pothole |", "| deer |", "| by worth, price 120 s |", "| every 3600 s |", "| 20 % | this zone |",
                     "| 20 % | counting messages |"):
            self.assertIn(text, self.page)
        self.assertNotIn("{", self.page)
        self.assertTrue((self.folder / "out/zone_life_polls.png").read_bytes().startswith(b"\x89PNG"))

    def test_the_same_seed_gives_the_same_figures(self):
        again = [run(MEASURE, ROOT / "config/hazards.yaml", "--days", 10, "--seed", 3).stdout for _ in range(2)]
        self.assertEqual(again[0], again[1])
        other = run(MEASURE, ROOT / "config/hazards.yaml", "--days", 10, "--seed", 4).stdout
        self.assertNotEqual(again[0], other)

    def test_every_rule_meets_the_same_world(self):
        ours, fixed = self.figures("weeks", "worth", 120), self.figures("weeks", "interval", 3600)
        self.assertEqual(ours["traversals"], fixed["traversals"])
        for name, entry in ours["classes"].items():
            self.assertEqual(entry["appeared"], fixed["classes"][name]["appeared"], name)

    def test_hostile_vehicles_achieve_less_than_against_counted_messages(self):
        def wrong(rule):
            return sum(entry["wrong_s"] for seed in (6, 7)
                       for entry in self.figures("hostile", rule, 0.2, seed)["classes"].values())
        self.assertLess(wrong("life"), wrong("count"))

    def test_the_page_can_be_written_again_without_simulating(self):
        done = run(SCRIPT, "--again", self.folder / "cache/quick.json", "--out", self.folder / "again", "--programs", "/")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.folder / "again/zone_life.md").read_text(encoding="utf-8"), self.page)

    def test_mistakes_are_one_sentence_and_exit_code_2(self):
        for program, arguments, named in (
                (SCRIPT, ("--again", "/nowhere.json"), "/nowhere.json"), (SCRIPT, ("--quik",), "--quik"),
                (SCRIPT, ("--quick", "--programs", "/nowhere", "--cache", self.folder / "c"), "livemap_measure_life"),
                (MEASURE, (ROOT / "config/hazards.yaml", "--polls", "often"), "'often'"),
                (MEASURE, (ROOT / "config/hazards.yaml", "--hostile", "2"), "hostile"),
                (MEASURE, ("/nowhere/hazards.yaml",), "/nowhere/hazards.yaml")):
            done = run(program, *arguments)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(named, done.stderr)
            self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)


if __name__ == "__main__":
    unittest.main()
