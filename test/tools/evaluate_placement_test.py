#!/usr/bin/python3
"""livemap_evaluate_placement as a person meets it.

    evaluate_placement_test.py EVALUATE_PLACEMENT
"""

import json
import subprocess
import sys
import unittest

PROGRAM = sys.argv.pop()


def run(*arguments):
    return subprocess.run([PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)


class EvaluatePlacementTest(unittest.TestCase):
    def test_more_vehicles_place_a_hazard_better(self):
        done = run("--json", "--seed", "4", "--seeds", "3")
        self.assertEqual(done.returncode, 0, done.stderr)
        figures = json.loads(done.stdout)
        self.assertEqual([fleet["vehicles"] for fleet in figures["fleets"]], [1, 2, 5, 10, 20])
        self.assertTrue(all(fleet["n"] == 3 for fleet in figures["fleets"]))
        self.assertLess(figures["fleets"][-1]["error_rms_m"], figures["reports"]["error_rms_m"])
        self.assertLess(figures["fleets"][-1]["error_rms_m"], 1.5)
        self.assertEqual(figures["streets"], 3)
        again = run("--json", "--seed", "4", "--seeds", "3")
        self.assertEqual(again.stdout, done.stdout, "the same seed gives the same figures")

    def test_a_table_for_people(self):
        done = run("--seeds", "1", "--multipath-m", "0")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(len(done.stdout.splitlines()), 7)

    def test_a_wrong_flag_is_refused_in_a_sentence(self):
        for arguments, part in ((("--positions", "map"), "accepted are gps and fused"), (("--seeds", "0"), "seeds"),
                                (("--fix-rate", "50"), "fix-rate"), (("--sights", "0"), "sights")):
            done = run(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertIn(part, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1)


if __name__ == "__main__":
    unittest.main()
