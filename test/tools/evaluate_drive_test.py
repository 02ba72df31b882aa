#!/usr/bin/python3
"""What `livemap evaluate drive` makes of the demo's lines, and its mistakes; the drives themselves take minutes.

    evaluate_drive_test.py SCRIPT
"""

import contextlib
import importlib.machinery
import importlib.util
import io
import json
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

SCRIPT = pathlib.Path(sys.argv.pop()).resolve()


def load():
    loader = importlib.machinery.SourceFileLoader("livemap_evaluate_drive", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


evaluate = load()


def line(processed, drive_s=10.0, found=2):
    """The demo's line of a drive with three hazards."""
    row = {"hazards": 3, "found": found, "missed": 3 - found, "false": 0, "position_error_m_mean": 0.5 if found else None}
    return {"frames_in": processed, "frames_processed": processed, "frames_dropped": 0, "detections": 4, "reports_sent": 2,
            "hazards_on_map": 2, "uplink_bytes": 1000, "drive_s": drive_s,
            "truth": {**row, "classes": {"pothole": dict(row)}, "position_errors_m": [0.4, 0.6][:found]}}


class EvaluateDriveTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.bags = [str(pathlib.Path(temporary.name) / name) for name in ("a.bag", "b.bag")]
        for bag in self.bags:
            pathlib.Path(bag).touch()

    def run_main(self, *arguments, lines=()):
        """Exit status, standard output and error, with the demo's lines instead of its runs."""
        answers = iter(lines)
        out, error = io.StringIO(), io.StringIO()
        with mock.patch.object(sys, "argv", ["livemap evaluate drive", *arguments]), contextlib.redirect_stdout(out), \
                contextlib.redirect_stderr(error), \
                mock.patch.object(evaluate, "replay", lambda drive, options: {"drive": drive, **next(answers)}):
            try:
                status = evaluate.main()
            except SystemExit as exit_:
                status = exit_.code
        return status, out.getvalue(), error.getvalue()

    def test_sums_are_over_all_drives(self):
        status, out, _ = self.run_main("--json", *self.bags, lines=[line(100), line(50, found=1)])
        summary = json.loads(out)
        self.assertEqual((status, summary["frames_processed"]), (0, 150))
        self.assertEqual((summary["truth"]["recall"], summary["truth"]["missed"]), (0.5, 3))
        self.assertNotIn("reason", summary)

    def test_a_drive_of_which_no_frame_was_looked_at_is_null_with_a_reason_and_exit_1(self):
        for flags in ([], ["--json"]):
            status, out, error = self.run_main(*flags, *self.bags, lines=[line(100), line(0, drive_s=0.0, found=0)])
            self.assertEqual(status, 1)
            self.assertIn(f"of the 0 frames of '{self.bags[1]}' none was looked at", error)
        summary = json.loads(out)
        self.assertIn(summary["reason"], error)
        self.assertIsNone(summary["uplink_mbit_s"])
        truth = summary["drives"][1]["truth"]
        self.assertEqual((truth["hazards"], truth["found"], truth["missed"], truth["position_errors_m"]), (3, None, None, []))
        self.assertIsNone(truth["classes"]["pothole"]["missed"])

    def test_with_the_true_boxes_the_detector_need_not_look(self):
        told = {**line(0), "frames_published": 20}
        self.assertEqual(self.run_main("--json", "--use-truth", self.bags[0], lines=[told])[0], 0)

    def test_a_demo_that_used_no_frame_is_a_figure_and_one_that_failed_is_none(self):
        demo = pathlib.Path(self.bags[0]).with_name("demo")
        for frames, is_figure in ((0, True), (20, False)):
            demo.write_text("#!/bin/sh\necho '" + json.dumps(line(frames)) + "'\nexit 1\n", encoding="utf-8")
            demo.chmod(0o755)
            options = mock.Mock(rate=1.0, positions="gps", use_truth=False)
            with mock.patch.object(evaluate.system, "program", lambda name: str(demo)):
                if is_figure:
                    self.assertEqual(evaluate.replay(self.bags[0], options)["frames_processed"], 0)
                else:
                    with self.assertRaisesRegex(evaluate.system.StartError, "code 1"):
                        evaluate.replay(self.bags[0], options)

    def test_bad_true_hazards_are_refused_before_anything_is_replayed(self):
        truth = pathlib.Path(self.bags[1]).with_suffix(".geojson")
        point = {"type": "Point", "coordinates": [-52.8, -28.45]}
        for text, words in (("", "are empty"), ("[1,2", "are no JSON (line 1)"), ("[1, 2]", "have no list of features"),
                            ('{"type":"FeatureCollection"}', "have no list of features"),
                            (json.dumps({"features": [{"properties": {"class": "pothole"}, "geometry": point},
                                                      {"properties": {}, "geometry": point}]}), "feature 2 of the true hazards"),
                            (json.dumps({"features": [{"properties": {"class": "pothole"}}]}), "has no point with longitude"),
                            ('{"features": [7]}', "has no class")):
            truth.write_text(text, encoding="utf-8")
            status, out, error = self.run_main(*self.bags, lines=[line(100), line(50)])
            self.assertEqual((status, out, error.count("\n")), (2, "", 1), error)
            self.assertIn(words, error)
            self.assertIn(str(truth.resolve()), error)
        truth.write_bytes(b"\xff\xfe\0")
        self.assertIn("no text in UTF-8", self.run_main(*self.bags)[2])
        truth.write_text("\ufeff" + json.dumps({"features": [{"properties": {"class": "pothole"}, "geometry": point}]}),
                         encoding="utf-8")
        self.assertEqual(self.run_main(*self.bags, lines=[line(100), line(50)])[0], 0, "a byte order mark is no fault")

    def test_mistakes_are_one_sentence_and_exit_2(self):
        for arguments, words in ((["--rate", "0", self.bags[0]], "--rate: '0', accepted is a number from 0.1 to 10"),
                                 (["--rate", "nan", self.bags[0]], "'nan'"), (["--rate", "-1", self.bags[0]], "'-1'"),
                                 ([self.bags[0], self.bags[0]], "given twice"), (["/nowhere.bag"], "/nowhere.bag")):
            status, out, error = self.run_main(*arguments)
            self.assertEqual((status, out), (2, ""), arguments)
            self.assertIn(words, error)


if __name__ == "__main__":
    unittest.main()
