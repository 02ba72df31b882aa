"""Samples: repeatable, and their labels stay on the objects."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

from detector import CLASSES
from detector.augment import SETTLING, Augmenter, Recipe
from detector.boxes import non_maximum_suppression
from detector.data import POTHOLE, TRAFFIC_CONE, DataError, Picture, read_simulated
from detector.inference import AnchorGrid, ViewConfig, decode_views, fuse, fuse_views, letterbox
from detector.validation import DetectorRunner

from .synthetic import write_simulated

CALM = dict(blur=0.0, noise=0.0, grey=0.0, hue=0.0, saturation=0.0, brightness=0.0, paste=0.0, shadow=0.0, mix=0.0, relight=0.0, erase=0.0, white=0.0)


def bright_square(class_id: int = POTHOLE) -> Picture:
    """A white square on black, 60 x 40 px."""
    image = np.zeros((400, 640, 3), np.uint8)
    image[180:220, 300:360] = 255
    return Picture(image, np.array([[300, 180, 360, 220]], np.float32), np.array([class_id]), [class_id])


def augmenter(recipe: Recipe) -> Augmenter:
    """An augmenter of one pothole picture and one cone picture."""
    groups = {"survey_potholes": [bright_square()], "cones": [bright_square(TRAFFIC_CONE)]}
    return Augmenter(groups, recipe, 416, 320)


class Reading(unittest.TestCase):
    def test_simulated_drives_are_read_by_class_names(self):
        with tempfile.TemporaryDirectory() as folder:
            picture, = read_simulated(write_simulated(Path(folder)))
        self.assertEqual(picture.classes.tolist(), [TRAFFIC_CONE, POTHOLE])
        self.assertEqual(sorted(picture.labelled_classes), [POTHOLE, TRAFFIC_CONE])
        np.testing.assert_allclose(picture.boxes[1], [480, 260, 544, 300], atol=0.01)

    def test_difficult_objects_are_read_apart(self):
        with tempfile.TemporaryDirectory() as folder:
            drive = write_simulated(Path(folder)) / "000001"
            (drive / "labels").rename(drive / "difficult")
            (drive / "labels").mkdir()
            (drive / "labels" / "000000.txt").write_text("")
            picture, = read_simulated(Path(folder))
        self.assertEqual(len(picture.boxes), 0)
        self.assertEqual(picture.difficult_classes.tolist(), [TRAFFIC_CONE, POTHOLE])

    def test_a_class_beyond_the_list_is_refused_by_file(self):
        with tempfile.TemporaryDirectory() as folder:
            root = write_simulated(Path(folder))
            (root / "000001" / "classes.txt").write_text("traffic_cone\n")
            with self.assertRaisesRegex(DataError, "000000.txt has a class that is not from 0 to 0"):
                read_simulated(root)


class Shares(unittest.TestCase):
    @staticmethod
    def drawn(groups, mosaic: float, simulated_share: float) -> np.ndarray:
        """What fraction of 300 samples comes from pictures of potholes, of cones and of simulated deer."""
        classes = {"survey_potholes": POTHOLE, "cones": TRAFFIC_CONE, "simulated": CLASSES.index("deer")}
        pictures = {name: [bright_square(classes[name])] for name in groups}
        source = Augmenter(pictures, Recipe(**{**CALM, "mosaic": mosaic}), 96, 64, simulated_share)
        samples = [source.draw(np.random.default_rng(index)) for index in range(300)]
        return np.mean([[sample.labelled[class_id] == 1 for class_id in classes.values()] for sample in samples], axis=0)

    def test_simulated_pictures_have_the_share_asked_for_in_views_and_in_mosaics(self):
        for mosaic in (0.0, 1.0):
            for share in (0.31, 0.7):
                potholes, cones, simulated = self.drawn(("survey_potholes", "cones", "simulated"), mosaic, share)
                self.assertAlmostEqual(simulated, share, delta=0.08)
                if mosaic == 0.0:
                    self.assertAlmostEqual(potholes / (potholes + cones), 0.41 / 0.52, delta=0.12)

    def test_without_simulated_pictures_their_share_does_not_matter(self):
        few, many = (self.drawn(("survey_potholes", "cones"), 0.0, share) for share in (0.1, 1.0))
        np.testing.assert_allclose(few, many)


class Samples(unittest.TestCase):
    def test_same_generator_same_sample(self):
        for recipe in (Recipe(), SETTLING):
            first, second = (augmenter(recipe).draw(np.random.default_rng([1, 2, 3])) for _ in range(2))
            np.testing.assert_array_equal(first.image, second.image)
            np.testing.assert_array_equal(first.boxes, second.boxes)

    def test_labels_stay_on_the_square(self):
        labels = 0
        for index in range(60):
            sample = augmenter(Recipe(**CALM)).draw(np.random.default_rng(index))
            for x1, y1, x2, y2 in sample.boxes:
                inside = sample.image[int(y1) + 2 : int(y2) - 1, int(x1) + 2 : int(x2) - 1]
                self.assertGreater(inside.mean(), 240)
                labels += 1
        self.assertGreater(labels, 40)

    def test_difficult_objects_are_ignored_where_they_are(self):
        picture = bright_square()
        picture.difficult, picture.boxes, picture.classes = picture.boxes, picture.boxes[:0], picture.classes[:0]
        sees = Augmenter({"survey_empty": [picture]}, Recipe(**{**CALM, "mosaic": 0.0}), 416, 320)
        ignored = 0
        for index in range(30):
            sample = sees.draw(np.random.default_rng(index))
            self.assertEqual(len(sample.boxes), 0)
            for x1, y1, x2, y2 in sample.ignored:
                inside = sample.image[int(y1) + 2 : int(y2) - 1, int(x1) + 2 : int(x2) - 1]
                if inside.size:
                    self.assertGreater(inside.mean(), 240)
                    ignored += 1
        self.assertGreater(ignored, 10)

    def test_mosaic_labels_one_class(self):
        for index in range(20):
            sample = augmenter(Recipe(mosaic=1.0)).draw(np.random.default_rng(index))
            self.assertEqual((sample.labelled == 1).sum(), 1)
            self.assertTrue((sample.labelled[sample.classes] == 1).all())

    def test_pasting_leaves_the_picture_alone(self):
        source = augmenter(Recipe())
        picture = source.groups["survey_potholes"][0]
        before = picture.image.copy()
        pasted = [source.paste_potholes(np.random.default_rng(index), picture) for index in range(20)]
        np.testing.assert_array_equal(picture.image, before)
        self.assertTrue(any(len(result.boxes) > 1 for result in pasted))


class Inference(unittest.TestCase):
    def test_letterbox_pads_right_and_bottom(self):
        image, scale = letterbox(np.zeros((480, 640, 3), np.uint8), 640, 400)
        self.assertEqual(image.shape, (400, 640, 3))
        self.assertAlmostEqual(scale, 400 / 480)
        self.assertEqual((image[0, 0, 0], image[0, 639, 0]), (0, 114))

    def test_decode_one_anchor_point(self):
        grid = AnchorGrid.of(64, 32)
        self.assertEqual(len(grid.cells), 16 * 8 + 8 * 4 + 4 * 2)
        raw, scores = np.zeros((168, 4), np.float32), np.zeros((168, 1), np.float32)
        row = 16 * 8 + 8 + 3  # stride 8, second row, fourth column
        raw[row], scores[row] = [0.5, 0.25, np.log(3), np.log(2)], 0.7
        ((detections,),) = decode_views(raw, scores, grid, 0.5, (128, 64))
        # Centre (28, 10), size 24 x 16 in the input; the picture is twice as large.
        np.testing.assert_allclose(detections, [[32, 4, 80, 36, 0.7]], rtol=1e-5)

    def test_a_smaller_view_lands_where_the_whole_one_does(self):
        grid = AnchorGrid.of(640, 400, (1.0, 0.8))
        self.assertEqual(grid.view_ends, (160 * 100 + 80 * 50 + 40 * 25, len(grid.cells)))
        raw, scores = np.zeros((len(grid.cells), 4), np.float32), np.zeros((len(grid.cells), 1), np.float32)
        # 16 x 16 px around (320, 200), at stride 4 of the whole picture and at stride 5 of the smaller one.
        for row, stride, score in ((50 * 160 + 80, 4, 0.9), (grid.view_ends[0] + 40 * 128 + 64, 5, 0.7)):
            raw[row, 2:], scores[row] = np.log(16 / stride), score
        found, = fuse_views(decode_views(raw, scores, grid, 1.0, (640, 400)))
        np.testing.assert_allclose(found, [[312, 192, 328, 208, 0.8]], rtol=1e-5)

    def test_what_one_view_alone_shows_is_doubted(self):
        here, there = [10, 10, 30, 20, 0.8], [60, 10, 80, 20, 0.6]
        fused = fuse([np.array([here, there]), np.array([[15, 10, 35, 20, 0.2]])])
        np.testing.assert_allclose(fused, [[11, 10, 31, 20, 0.5], [60, 10, 80, 20, 0.3]], rtol=1e-5)

    def test_what_the_mirrored_picture_shows_is_fused_at_its_place(self):
        def bright(image):
            """A network that is sure of the brightest cell at stride 4, of the right half as sure as of the left one times 0.5."""
            raw, scores = np.zeros((64 * 32 // 16 + 8 * 4 + 4 * 2, 4), np.float32), np.zeros((168, 1), np.float32)
            row, column = np.argwhere(image[0, ::4, ::4] == image.max())[0]
            raw[row * 16 + column, :2], scores[row * 16 + column] = 0.5, 0.8 if column < 8 else 0.4
            return raw, scores

        picture = np.zeros((32, 64, 3), np.uint8)
        picture[8:12, 12:16] = 255
        found, = DetectorRunner(bright, ViewConfig(64, 32, mirrored=True)).detect(picture)
        np.testing.assert_allclose(found, [[12, 8, 16, 12, 0.6]], rtol=1e-5)

    def test_suppression_keeps_the_best(self):
        boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [50, 50, 60, 60]], float)
        kept = non_maximum_suppression(boxes, np.array([0.5, 0.9, 0.1]), 0.5)
        self.assertEqual(kept.tolist(), [1, 2])


if __name__ == "__main__":
    unittest.main()
