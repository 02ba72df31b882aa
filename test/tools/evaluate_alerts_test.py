#!/usr/bin/python3
"""livemap_evaluate_alerts as a person meets it.

    evaluate_alerts_test.py EVALUATE_ALERTS
"""

import json
import subprocess
import sys
import unittest

PROGRAM = sys.argv.pop()


def run(flags):
    return subprocess.run([PROGRAM, *flags.split()], capture_output=True, text=True, timeout=120, check=False)


class EvaluateAlertsTest(unittest.TestCase):
    def figures(self, flags):
        done = run("--json " + flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_the_sum_is_that_of_the_scenarios(self):
        figures = self.figures("--drives 2")
        self.assertEqual(len(figures["scenarios"]), 8)
        for key in ("drives", "on_way", "early", "late", "missed", "alerts", "false_alerts", "doubles"):
            self.assertEqual(figures[key], sum(each[key] for each in figures["scenarios"].values()), key)
        self.assertEqual(figures["on_way"], figures["early"] + figures["late"] + figures["missed"])

    def test_the_same_seed_gives_the_same_figures(self):
        flags = "--drives 2 --scenario crossings,turns"
        self.assertEqual(self.figures(flags), self.figures(flags))
        self.assertNotEqual(self.figures(flags), self.figures(flags + " --seed 4"))

    def test_a_perfect_receiver_and_map_warn_early_on_a_straight_street(self):
        figures = self.figures("--drives 4 --scenario crossings --fix-noise-m 0 --fix-bias-m 0 --place-sigma-m 0")
        self.assertGreater(figures["on_way"], 0)
        self.assertGreaterEqual(figures["early_share"], 0.9)
        self.assertEqual(figures["doubles"], 0)

    def test_the_direction_in_which_hazards_are_passed_tells_a_bridges_from_those_below(self):
        flags = "--drives 10 --scenario bridges --per-km 5 --streets true --wrong-course-share 0 --no-course-share "
        told = self.figures(flags + "0")["with_streets"]
        not_told = self.figures(flags + "1")["with_streets"]
        self.assertEqual(told["on_way"], not_told["on_way"])
        self.assertLess(told["missed"], not_told["missed"])
        self.assertLess(told["false_alerts"], not_told["false_alerts"])

    def test_what_the_zone_tells_of_no_hazard_can_be_told_wrongly_of_none(self):
        flags = "--drives 2 --scenario bridges,crossings --streets true --no-course-share 1"
        self.assertEqual(self.figures(flags), self.figures(flags + " --wrong-course-share 1 --course-noise-deg 90"))

    def test_a_share_above_1_is_refused_by_name(self):
        done = run("--no-course-share 1.1")
        self.assertEqual(done.returncode, 2)
        self.assertIn("no-course-share", done.stderr)

    def test_nothing_measured_is_null_with_a_reason(self):
        done = run("--json --drives 1 --scenario turns --per-km 0.001")
        self.assertEqual(done.returncode, 1)
        figures = json.loads(done.stdout)
        self.assertIsNone(figures["early_share"])
        self.assertIsNone(figures["lead_p50_s"])
        self.assertIn("no hazard", figures["reason"])

    def test_an_unknown_scenario_is_refused_by_name(self):
        done = run("--scenario moon")
        self.assertEqual(done.returncode, 2)
        self.assertIn("--scenario is 'moon'", done.stderr)
        self.assertIn("roundabouts", done.stderr)


if __name__ == "__main__":
    unittest.main()
