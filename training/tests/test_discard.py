"""The send / don't-send classifier: its rule, its loss, its figures, and the command lines on a generated data set."""

import contextlib
import io
import shutil
import tempfile
import unittest
from pathlib import Path

import cv2
import numpy as np
import torch
import yaml

import export_discard
import train_discard
from common import training
from detector import CLASSES, onnx_model
from detector.data import Picture
from detector.loss import Target
from detector.network import Detector
from early_discard import INPUT_HEIGHT, INPUT_WIDTH, figures, labels, loss, network, photos

from .synthetic import TRAINING_SECTION, write_data, write_sets

LEVEL = labels.Camera(500, 500, 319.5, 199.5, 1.6, 0, 0, 0)
"""A camera that looks straight ahead, 1.6 m above the road."""


def box_with_foot(u, v):
    return np.array([[u - 10, v - 20, u + 10, v]], np.float32)


class Rule(unittest.TestCase):
    def test_a_foot_lies_where_its_ray_meets_the_road(self):
        for distance in (5.0, 12.0, 29.0):
            row = 200 + 500 * 1.6 / distance
            self.assertAlmostEqual(float(labels.ground_distances_m(LEVEL, box_with_foot(320, row))[0]), distance, places=4)
        self.assertEqual(labels.ground_distances_m(LEVEL, box_with_foot(320, 150))[0], np.inf)

    def test_a_camera_that_looks_down_sees_a_row_nearer(self):
        down = labels.Camera(500, 500, 319.5, 199.5, 1.6, 0, 10, 0)
        self.assertAlmostEqual(float(labels.ground_distances_m(down, box_with_foot(320, 200))[0]), 1.6 / np.tan(np.radians(10)), places=4)

    def test_what_is_too_far_to_be_reported_is_no_reason_to_send(self):
        image = np.zeros((400, 640, 3), np.uint8)
        near, far = box_with_foot(320, 300), box_with_foot(320, 200 + 500 * 1.6 / 31)
        picture = Picture(image, np.vstack([near, far]), np.array([0, 1]), [0])
        classes = labels.prepared(picture, LEVEL).classes
        self.assertEqual(classes.tolist(), [labels.REPORTABLE, labels.FAR])
        self.assertTrue(labels.holds_hazard(labels.prepared(picture, LEVEL)))
        only_far = Picture(image, far, np.array([1]), [0])
        self.assertFalse(labels.holds_hazard(labels.prepared(only_far, LEVEL)))

    def test_in_a_photo_the_height_of_a_box_decides(self):
        photo = Picture(np.zeros((400, 400, 3), np.uint8), np.array([[0, 0, 9, 11], [0, 0, 9, 9]], np.float32), np.array([1, 1]), [1])
        self.assertEqual(labels.is_reportable(photo, None).tolist(), [True, False])


def target(boxes, classes, ignored=()):
    return Target(
        torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4), torch.tensor(classes, dtype=torch.int64),
        torch.tensor(ignored, dtype=torch.float32).reshape(-1, 4), torch.ones(len(CLASSES)),
    )


class Loss(unittest.TestCase):
    def test_cells_of_a_box_are_hazards_its_rim_and_far_ones_unknown(self):
        cells = loss.cell_targets([target([[32, 32, 64, 48], [160, 32, 176, 48]], [labels.REPORTABLE, labels.FAR])], 26, 40)[0]
        self.assertTrue((cells[4:6, 4:8] == loss.HAZARD).all())
        self.assertEqual(float(cells[3, 4]), loss.UNKNOWN)
        self.assertTrue((cells[4:6, 20:22] == loss.UNKNOWN).all())
        self.assertEqual(float(cells[20, 20]), loss.CALM)
        self.assertEqual(int((cells == loss.HAZARD).sum()), 8)

    def test_the_smallest_box_has_a_cell(self):
        cells = loss.cell_targets([target([[33, 33, 35, 34]], [labels.REPORTABLE])], 26, 40)[0]
        self.assertEqual(int((cells == loss.HAZARD).sum()), 1)

    def test_being_right_costs_less_than_being_wrong(self):
        targets = [target([[32, 32, 64, 48]], [labels.REPORTABLE]), target([], [])]
        right = torch.full((2, 1, 26, 40), -6.0)
        wrong = torch.full((2, 1, 26, 40), -6.0)
        right[0, 0, 4:6, 4:8] = 6
        wrong[1, 0, 4:6, 4:8] = 6
        for one, other in zip(loss.losses(right, targets), loss.losses(wrong, targets)):
            self.assertLess(float(one), float(other))


    def test_background_that_says_nothing_teaches_nothing(self):
        logits = torch.full((2, 1, 26, 40), 3.0)
        silent, calm = target([], []), target([], [])
        silent.labelled = torch.zeros(len(CLASSES))
        self.assertEqual([float(part) for part in loss.losses(logits[:1], [silent])], [0.0, 0.0])
        alone, both = (float(loss.losses(logits[: len(given)], given)[1]) for given in ([calm], [calm, silent]))
        self.assertAlmostEqual(alone, both, places=5)

    def test_a_frame_with_a_hazard_is_judged_where_the_hazard_is(self):
        boxes, elsewhere = target([[32, 32, 64, 48]], [labels.REPORTABLE]), torch.full((1, 1, 26, 40), -3.0)
        elsewhere[0, 0, 20, 20] = 3.0
        self.assertGreater(float(loss.losses(elsewhere, [boxes])[1]), 3.0)


def seen(score):
    """A judge that finds a cone of that score in every picture."""
    found = [np.zeros((0, 5)) for _ in CLASSES]
    found[CLASSES.index("traffic_cone")] = np.array([[10, 10, 50, 60, score]])
    return lambda image: found


class Photos(unittest.TestCase):
    image = np.zeros((400, 400, 3), np.uint8)

    def photo(self, labelled, absent=()):
        ids = [[CLASSES.index(name) for name in names] for names in (labelled, absent)]
        return Picture(self.image, np.zeros((0, 4), np.float32), np.zeros(0, np.int64), ids[0], absent_classes=ids[1])

    def test_what_nobody_looked_for_makes_the_background_unknown(self):
        for photo, judge, expected in (
            (self.photo(CLASSES), None, labels.Background.KNOWN),
            (self.photo(CLASSES[:1]), None, labels.Background.UNKNOWN),
            (self.photo(CLASSES[:1], CLASSES[1:]), None, labels.Background.LIKELY),
            (self.photo(CLASSES[:1]), seen(0.0), labels.Background.KNOWN),
        ):
            self.assertEqual(photos.judged(photo, judge)[1], expected)

    def test_what_the_judge_finds_of_an_unlabelled_class_is_unknown(self):
        for labelled, score, expected in ((["pothole"], 0.2, 1), (["pothole"], 0.05, 0), (["traffic_cone"], 0.2, 0)):
            picture, background = photos.judged(self.photo(labelled), seen(score))
            self.assertEqual(len(picture.difficult), expected)
            self.assertEqual(len(labels.prepared(picture, None, background).difficult), expected)

    def test_a_photo_is_shown_whole_filling_the_view_and_from_nearer(self):
        whole, cut, near = photos.views_of(self.photo(CLASSES), labels.Background.KNOWN)
        self.assertEqual(whole.image.shape[:2], (INPUT_HEIGHT, INPUT_HEIGHT))
        self.assertEqual(cut.image.shape[:2], (INPUT_WIDTH, INPUT_WIDTH))
        self.assertGreater(near.image.shape[1], INPUT_WIDTH)

    def test_a_painted_out_street_shows_the_road_where_its_hazard_was(self):
        image = np.full((400, 640, 3), 120, np.uint8)
        image[210:240, 310:350] = 20
        for box, expected in (([308, 208, 352, 242], True), ([20, 20, 620, 380], False)):
            street = Picture(image, np.array([box], np.float32), np.array([0]), [0])
            painted = photos.painted_out(street)
            self.assertEqual(painted is not None, expected)
            if painted:
                self.assertEqual(len(painted.boxes), 0)
                self.assertGreater(int(painted.image.min()), 110)

    def test_low_debris_counts_where_a_cone_of_its_height_does_not(self):
        box = np.array([[0, 0, 9, 6]], np.float32)
        for name, expected in (("debris", [True]), ("traffic_cone", [False])):
            self.assertEqual(labels.is_reportable(Picture(self.image, box, np.array([CLASSES.index(name)]), []), None).tolist(), expected)

    def test_photos_with_far_boxes_alone_are_not_counted(self):
        scored = [figures.ScoredPhoto(0.9, ["debris"], False), figures.ScoredPhoto(0.5, [], False), figures.ScoredPhoto(0.1, [], True)]
        self.assertEqual(figures.as_drive(scored).hazards.tolist(), [True, False])
        self.assertEqual(figures.by_class({"a": scored})["debris"].scores.tolist(), [0.9])


class Figures(unittest.TestCase):
    drive = figures.ScoredDrive(
        np.array([0.9, 0.2, 0.1, 0.6, 0.3]), np.array([True, True, False, True, False]), np.array([0.0, 10.0, 20.0, 40.0, 50.0])
    )

    def test_an_event_is_recalled_by_its_best_frame(self):
        self.assertEqual(figures.event_scores(self.drive), [0.9, 0.6])

    def test_at_a_threshold(self):
        found = figures.figures({"a": self.drive}, 0.3)
        self.assertAlmostEqual(found.recall, 2 / 3)
        self.assertAlmostEqual(found.precision, 2 / 3)
        self.assertAlmostEqual(found.share_sent, 0.6)
        self.assertEqual((found.event_recall, found.events), (1.0, 2))
        self.assertAlmostEqual(found.ranking, 5 / 6)

    def test_what_nothing_was_counted_for_is_none(self):
        calm = figures.ScoredDrive(np.array([0.1, 0.2]), np.zeros(2, bool), np.array([0.0, 10.0]))
        found = figures.figures({"a": calm}, 0.3)
        self.assertEqual((found.recall, found.precision, found.event_recall, found.ranking), (None, None, None, None))
        self.assertEqual(found.share_sent, 0.0)
        self.assertIsNone(figures.figures({}, 0.3).share_sent)

    def test_the_threshold_keeps_the_recall(self):
        many = figures.ScoredDrive(np.arange(1, 11) / 20, np.ones(10, bool), np.arange(10.0))
        threshold = figures.threshold_for_recall({"a": many}, 0.9)
        self.assertAlmostEqual(threshold, 0.1)
        self.assertAlmostEqual(figures.figures({"a": many}, threshold).recall, 0.9)


def quietly(program, *arguments):
    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        status = program.main([str(argument) for argument in arguments])
    return status, errors.getvalue()


class Programs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = Path(cls.folder.name)
        cls.data = write_data(cls.root / "data")
        sections = cls.data / "road_survey"
        shutil.copytree(sections / TRAINING_SECTION, sections / labels.CALIBRATION_SECTIONS[0])
        cls.detector = cls.root / "detector.onnx"
        cls.threads = torch.get_num_threads()
        onnx_model.export(Detector(len(CLASSES)), cls.detector)

    @classmethod
    def tearDownClass(cls):
        torch.set_num_threads(cls.threads)
        cls.folder.cleanup()

    def train(self, out, *more):
        return quietly(
            train_discard, "--data", self.data, "--out", self.root / out, "--detector", self.detector, "--epochs", 3, "--samples", 4,
            "--batch", 2, *more,
        )

    def test_a_stopped_run_continues_as_if_it_had_not_and_its_export_is_the_same_in_opencv(self):
        self.assertEqual(self.train("whole"), (0, ""))
        save = training.save_atomically

        def stop_after_second(content, path):
            save(content, path)
            if content["epoch"] == 2:
                raise KeyboardInterrupt

        training.save_atomically = stop_after_second
        try:
            with self.assertRaises(KeyboardInterrupt):
                self.train("stopped")
        finally:
            training.save_atomically = save
        self.assertEqual(self.train("stopped", "--resume"), (0, ""))
        whole, continued = (torch.load(self.root / name / "last.pt")["average"] for name in ("whole", "stopped"))
        for name, tensor in whole.items():
            torch.testing.assert_close(continued[name], tensor, rtol=0, atol=0, msg=name)
        models = self.root / "models"
        models.mkdir()
        exported = quietly(export_discard, "--training", self.root / "whole", "--data", self.data, "--out", models)
        self.assertEqual(exported, (0, ""))
        manifest = yaml.safe_load((models / "early-discard.yaml").read_text())
        self.assertEqual(manifest["head"], {"type": "score", "output": "score"})
        found = cv2.dnn.readNetFromONNX(str(models / "early-discard.onnx"))
        found.setInput(np.zeros((1, 3, INPUT_HEIGHT, INPUT_WIDTH), np.float32))
        self.assertEqual(found.forward().shape, (1, 1))

    def test_it_learns_from_sets_and_is_measured_on_their_held_out_parts(self):
        catalogue = write_sets(self.data)
        self.assertEqual(self.train("sets", "--sets", catalogue), (0, ""))
        models = self.root / "models_of_sets"
        models.mkdir()
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            self.assertEqual(export_discard.main([
                "--training", str(self.root / "sets"), "--data", str(self.data), "--out", str(models), "--sets", str(catalogue),
            ]), 0)
        for name in ("cattle", "holes", "composed", "class deer", "class pothole"):
            self.assertRegex(said.getvalue(), f"  {name}: [1-9]")
        status, errors = self.train("sets", "--resume")
        self.assertEqual((status, len(errors.splitlines())), (2, 1), errors)

    def test_it_is_small(self):
        backbone = sum(parameter.numel() for name, parameter in Detector(len(CLASSES)).named_parameters() if "backbone" in name)
        self.assertLess(sum(parameter.numel() for parameter in network.Head().parameters()) + backbone, 800000)

    def test_refusals_are_one_sentence_and_status_2(self):
        nowhere = self.root / "nowhere"
        for program, arguments in (
            (train_discard, ("--data", nowhere, "--out", self.root / "new")),
            (train_discard, ("--epochs", 0)),
            (train_discard, ("--batch", 1)),
            (train_discard, ("--data", self.data, "--out", self.root / "new", "--detector", nowhere)),
            (train_discard, ("--data", self.data, "--out", self.root / "new", "--sets", nowhere)),
            (train_discard, ("--data", self.data, "--out", self.root / "new", "--judge", nowhere)),
            (export_discard, ("--training", nowhere, "--data", self.data, "--out", self.root)),
            (export_discard, ("--out", nowhere)),
        ):
            status, errors = quietly(program, *arguments)
            self.assertEqual(status, 2, arguments)
            self.assertEqual(len(errors.strip().splitlines()), 1, errors)


if __name__ == "__main__":
    unittest.main()
