#!/usr/bin/python3
"""`livemap bench fleet` against a real broker and zone, with a small fleet; and its mistakes.

    bench_fleet_test.py SCRIPT
"""

import importlib.machinery
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(sys.argv.pop()).resolve()
ROOT = SCRIPT.parents[1]
sys.path.insert(0, str(SCRIPT.parent / "lib"))
import city_traffic  # noqa: E402
from system_error import StartError  # noqa: E402


def the_script():
    """The script as a module."""
    loader = importlib.machinery.SourceFileLoader("livemap_bench_fleet", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def bench(*flags):
    return subprocess.run([str(SCRIPT), "--root", str(ROOT), *flags], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, timeout=240, check=False)


class BenchFleetTest(unittest.TestCase):
    def test_a_small_fleet_stays_connected_and_is_told(self):
        with tempfile.TemporaryDirectory() as out:
            done = bench("--quick", "--json", "--out", out)
            self.assertEqual(done.returncode, 0, done.stderr)
            figures = json.loads(done.stdout)
            page = (pathlib.Path(out) / "fleet.md").read_text(encoding="utf-8")
        fleet, = figures["fleets"]
        self.assertEqual((fleet["connected"], fleet["lost"], fleet["refused"]), (20, 0, 0))
        self.assertGreater(fleet["positions"], 40)
        self.assertEqual(fleet["joined"], 20)
        self.assertGreater(fleet["up_bit_s"], 500)
        self.assertEqual((fleet["viewers_connected"], fleet["viewers_lost"]), (9, 0), "the tenth is slow")
        # Whether so few vehicles confirm a hazard in five seconds is chance.
        if fleet["announcements"]:
            self.assertGreater(fleet["viewer_events"], 0)
        self.assertIn("| 20 of 20 |", page)
        self.assertEqual(set(fleet["cores"]), {"broker", "bridge", "zone", "fleet", "machine"})

    def test_vehicles_that_do_not_know_of_cells_are_told_too(self):
        with tempfile.TemporaryDirectory() as out:
            done = bench("--quick", "--to-all", "--json", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        fleet, = json.loads(done.stdout)["fleets"]
        self.assertEqual((fleet["connected"], fleet["cells_told"]), (20, 0))

    def test_the_sum_on_paper_stands_beside_what_a_larger_fleet_took(self):
        def fleet(vehicles, cores, bits):
            return {"vehicles": vehicles, "cores": dict.fromkeys(("broker", "bridge", "zone"), cores),
                    "notice_bit_s": bits, "near_notice_bit_s": bits / 2}
        lines = the_script().paper_checked(fleet(1000, 0.1, 60), fleet(5000, 0.3, 250))
        self.assertIn("| cores of the zone | 0.50 | 0.30 |", lines)
        self.assertIn("| notices, kbit/s down of one vehicle | 0.30 | 0.25 |", lines)

    def test_a_wrong_number_of_vehicles_is_one_sentence(self):
        done = bench("--vehicles", "0")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertEqual(done.stderr, "livemap bench fleet: --vehicles is 0, accepted are 1 to 12000, together, see --help\n")

    def test_sumo_that_is_missing_is_one_sentence(self):
        path, os.environ["PATH"] = os.environ["PATH"], "/nonexistent"
        try:
            with self.assertRaisesRegex(StartError, "'netgenerate' is not installed, --movement sumo needs it: apt install sumo"):
                city_traffic.require_sumo()
        finally:
            os.environ["PATH"] = path


if __name__ == "__main__":
    unittest.main()
