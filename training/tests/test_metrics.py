"""Detection figures on cases small enough to work out by hand."""

import unittest

import numpy as np

from detector.data import Picture
from detector.metrics import (
    ScoredFrame, average_precision, best_f1_threshold, calibrate_threshold, drive_figures, driven_km, events, f1_score,
    false_reports, highest_false_scores,
)
from detector.mistakes import mistakes_of

BOX = [100, 100, 140, 120]
SHIFTED = [104, 100, 144, 120]  # IoU with BOX 36 / 44
FAR = [300, 300, 340, 320]


def frame(chainage_m=0.0, labels=(), detections=()):
    """A frame of lists."""
    return ScoredFrame(
        np.array(labels, float).reshape(-1, 4), np.array(detections, float).reshape(-1, 5), float(chainage_m)
    )


class AveragePrecision(unittest.TestCase):
    def test_perfect(self):
        self.assertAlmostEqual(average_precision([frame(labels=[BOX], detections=[SHIFTED + [0.9]])], 0.5), 1.0)

    def test_a_second_detection_of_a_label_is_false(self):
        frames = [frame(labels=[BOX, FAR], detections=[BOX + [0.9], SHIFTED + [0.8], FAR + [0.7]])]
        self.assertAlmostEqual(average_precision(frames, 0.5), 0.5 * 1 + 0.5 * 2 / 3)

    def test_strict_overlap(self):
        frames = [frame(labels=[BOX], detections=[SHIFTED + [0.9]])]
        self.assertEqual(average_precision(frames, 0.9), 0.0)

    def test_without_detections_is_zero_and_without_labels_none(self):
        self.assertEqual(average_precision([frame(labels=[BOX])], 0.5), 0.0)
        self.assertIsNone(average_precision([frame(detections=[BOX + [0.5]])], 0.5))
        self.assertIsNone(average_precision([], 0.5))


class Mistakes(unittest.TestCase):
    PICTURE = Picture(np.zeros((400, 640, 3), np.uint8), np.zeros((0, 4)), np.zeros(0, int), [0])

    def test_are_labels_found_below_the_threshold_and_detections_above_it_that_overlap_none(self):
        one = frame(labels=[BOX, FAR], detections=[SHIFTED + [0.3], [500, 100, 540, 120, 0.6], [500, 200, 540, 220, 0.4]])
        found = mistakes_of("pothole", "roads", self.PICTURE, one, 0.5)
        self.assertEqual([(mistake.kind, list(mistake.box), mistake.score) for mistake in found],
                         [("missed", BOX, 0.3), ("missed", FAR, 0.0), ("false", [500, 100, 540, 120], 0.6)])

    def test_are_none_where_every_label_was_found(self):
        self.assertEqual(mistakes_of("pothole", "roads", self.PICTURE, frame(labels=[BOX], detections=[SHIFTED + [0.6]]), 0.5), [])


class DifficultObjects(unittest.TestCase):
    def setUp(self):
        self.frame = frame(labels=[BOX], detections=[FAR + [0.9], BOX + [0.8], [330, 300, 370, 320, 0.7]])
        self.frame.difficult = np.array([FAR], float)

    def test_need_not_be_found_and_are_not_wrong(self):
        self.assertAlmostEqual(average_precision([self.frame], 0.5), 1.0)
        self.assertEqual(highest_false_scores([self.frame], 0.5).tolist(), [0.7], "less than half of it lies in the difficult box")

    def test_do_not_take_detections_from_labels(self):
        self.frame.difficult = np.array([BOX], float)
        self.assertAlmostEqual(average_precision([self.frame], 0.5), 0.5)


class Drives(unittest.TestCase):
    def test_events_split_at_gaps_over_12_m(self):
        drive = [frame(0, [BOX]), frame(5), frame(12, [BOX]), frame(25, [BOX]), frame(30)]
        self.assertEqual([len(event) for event in events(drive)], [2, 1])

    def test_long_gaps_count_12_m(self):
        self.assertAlmostEqual(driven_km([frame(0), frame(5), frame(1000)]), 0.017)

    def test_false_detections_of_12_m_are_one_report(self):
        drive = [frame(metres, detections=[FAR + [0.6]]) for metres in (0, 5, 12, 13, 20, 26)]
        scores = highest_false_scores(drive, 0.5)
        self.assertEqual(false_reports(drive, scores, 0.5), 3)  # begun at 0, 13 and 26
        self.assertEqual(false_reports(drive, scores, 0.7), 0)

    def test_figures(self):
        drive = [frame(0, [BOX], [SHIFTED + [0.6]]), frame(10), frame(20, detections=[FAR + [0.4]]), frame(30, [FAR])]
        figures = drive_figures({"drive": drive}, 0.3)
        self.assertEqual((figures.event_count, figures.event_recall), (2, 0.5))
        self.assertAlmostEqual(figures.false_reports_per_km, 1 / 0.030)

    def test_figures_of_nothing_are_none(self):
        for drives in ({}, {"drive": [frame(0, detections=[FAR + [0.9]])]}):
            found = drive_figures(drives, 0.3)
            self.assertEqual((found.event_count, found.event_recall, found.event_recall_iou30), (0, None, None))
            self.assertEqual((found.false_reports_per_km, found.false_detections_per_km), (None, None))
        self.assertIsNone(f1_score([frame()], 0.5, 0.5))

    def test_threshold_is_the_lowest_within_the_limit(self):
        drive = [frame(0, detections=[FAR + [0.405]]), frame(10)]
        self.assertEqual(calibrate_threshold({"drive": drive}, 10.0), 0.41)

    def test_best_f1_drops_the_false_detection(self):
        frames = [frame(labels=[BOX], detections=[BOX + [0.805], FAR + [0.305]])]
        self.assertEqual(best_f1_threshold(frames, 0.5), 0.31)


if __name__ == "__main__":
    unittest.main()
