"""Sets of photos: which classes count, what is held out, and signs put into pictures."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

from detector import CLASSES, cutouts, sets, signs
from detector.augment import ABSENT_WEIGHT, Augmenter, Recipe, group_shares
from detector.data import POTHOLE, TRAFFIC_CONE, DataError, Picture, read_labelled_folder
from detector.validation import ClassFigure, HeldOut, selection_figure, validate_held_out

from .synthetic import write_own, write_sets

DEER, SIGN, MACHINE = (CLASSES.index(name) for name in ("deer", "road_work_sign", "construction_machine"))


class Folder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = Path(self.folder.name)


class Catalogues(Folder):
    def test_a_set_is_read_with_its_own_classes_and_split_by_scenes(self):
        catalogue = sets.read_catalogue(write_sets(self.root))
        splits = sets.read_splits(catalogue, self.root)
        cattle = splits["cattle"]
        self.assertEqual([p.name for p in cattle.held_out], ["street2-1", "street2-10"])
        self.assertEqual([p.name for p in cattle.training], ["street1-2", "street1-10"])
        # animal_other is renamed; what is not said to be labelled is not.
        self.assertEqual({int(c) for p in cattle.training for c in p.classes}, {DEER})
        self.assertEqual((cattle.training[0].labelled_classes, cattle.training[0].absent_classes), ([DEER], [POTHOLE]))
        self.assertEqual([p.name for p in splits["holes"].held_out], ["n2"])
        self.assertEqual([p.name for p in splits["holes"].training], ["n1", "n10", "n11", "n12", "n20"])

    def test_a_source_left_out_is_held_out_as_a_whole(self):
        catalogue = sets.read_catalogue(write_sets(self.root))
        splits = sets.read_splits(catalogue, self.root, ["cattle"])
        self.assertEqual((len(splits["cattle"].training), len(splits["cattle"].held_out)), (0, 4))
        with self.assertRaisesRegex(DataError, "no set horses to leave out, there are cattle, holes"):
            sets.read_splits(catalogue, self.root, ["horses"])

    def test_wrong_entries_are_refused(self):
        path = write_sets(self.root)
        text = path.read_text()
        for right, wrong, said in (
            ("labelled: [deer]", "labelled: [traffic_cone]", "deer is labelled"), ("labelled: [deer]", "labelled: [cow]", "cow"),
            ("absent: [pothole]", "absent: [deer]", "absent"), ("held_out: {blocks: 1}", "keep: 1", "unknown entry 'keep'"),
            ("labelled: [deer]", "", "labelled"), ("folder: cattle", "folder: nowhere", "nowhere"),
        ):
            path.write_text(text.replace(right, wrong, 1))
            with self.assertRaisesRegex(DataError, said):
                sets.read_splits(sets.read_catalogue(path), self.root)

    def test_an_own_folder_may_say_which_classes_it_labels(self):
        own = write_own(self.root / "own")
        (own / "labelled_classes.txt").write_text("pothole\n")
        self.assertEqual([p.labelled_classes for p in read_labelled_folder(own)], [[POTHOLE]] * 2)
        (own / "labelled_classes.txt").write_text("unicorn\n")
        with self.assertRaisesRegex(DataError, "sinkhole, pothole"):
            read_labelled_folder(own)


class Samples(Folder):
    def test_what_a_set_does_not_label_does_not_count_and_what_is_absent_counts_a_little(self):
        splits = sets.read_splits(sets.read_catalogue(write_sets(self.root)), self.root)
        groups = {f"set:{name}": split.training for name, split in splits.items()}
        source = Augmenter(groups, Recipe(mosaic=0.5), 416, 320)
        seen = set()
        for index in range(30):
            labelled = source.draw(np.random.default_rng(index)).labelled
            seen.add(tuple(np.flatnonzero(labelled == 1)))
            self.assertEqual(labelled[TRAFFIC_CONE], 0)
            if labelled[DEER] == 1:
                self.assertAlmostEqual(float(labelled[POTHOLE]), ABSENT_WEIGHT, places=6)
        self.assertEqual(seen, {(POTHOLE,), (DEER,)})

    def test_shares_add_up_and_groups_of_a_kind_share_by_weight(self):
        shares = group_shares({"set:a": 3.0, "set:b": 1.0, "cones": 5.0, "simulated": 9.0}, 0.5)
        self.assertAlmostEqual(sum(shares.values()), 1)
        self.assertAlmostEqual(shares["simulated"], 0.5)
        self.assertAlmostEqual(shares["set:a"], 3 * shares["set:b"])


class Signs(Folder):
    def setUp(self):
        super().setUp()
        write_sets(self.root)
        self.faces = [signs.read_faces(self.root / "signs", "road_work", held_out) for held_out in (False, True)]

    def test_crops_are_split_and_cut_along_their_outline(self):
        training, held_out = self.faces
        self.assertEqual([len(part) for part in (training.road_work, training.other, held_out.road_work, held_out.other)], [1, 1, 1, 1])
        alpha = training.road_work[0].rgba[..., 3]
        self.assertEqual((alpha[2, 2], alpha[-3, 2] > 0, alpha[2, alpha.shape[1] // 2] > 0), (0, True, True))

    def test_held_out_scenes_are_the_same_each_time_and_label_signs_alone(self):
        street = Picture(np.full((400, 640, 3), 120, np.uint8), np.array([[10, 300, 60, 350]], np.float32), np.array([POTHOLE]), [POTHOLE])
        first, second = (signs.compose_held_out([street] * 8, self.faces[1], "road_work_sign") for _ in range(2))
        self.assertGreater(sum(len(scene.boxes) for scene in first), 4)
        self.assertTrue((street.image == 120).all())
        for one, other in zip(first, second):
            np.testing.assert_array_equal(one.image, other.image)
            self.assertEqual(one.labelled_classes, [SIGN])
            self.assertTrue((one.classes == SIGN).all())
            for x1, y1, x2, y2 in one.boxes.astype(int):
                self.assertGreater(np.abs(one.image[y1:y2, x1:x2].astype(int) - 120).max(), 20)

    def test_training_puts_signs_into_pictures_and_keeps_their_labels(self):
        street = Picture(np.full((400, 640, 3), 120, np.uint8), np.array([[10, 300, 60, 350]], np.float32), np.array([POTHOLE]), [POTHOLE])
        source = Augmenter({"composed": [street]}, Recipe(), 416, 320, pasted=sets.Pasted(self.faces[0], "road_work_sign"))
        classes = np.concatenate([source.draw(np.random.default_rng(index)).classes for index in range(30)])
        self.assertEqual(set(classes.tolist()), {POTHOLE, SIGN})


class CutOuts(unittest.TestCase):
    def test_an_object_is_cut_out_and_stands_on_another_road(self):
        image = np.random.default_rng(1).normal(120, 4, (200, 300, 3)).clip(0, 255).astype(np.uint8)
        image[60:140, 100:180] = (230, 40, 30)
        boxes = np.array([[98, 58, 182, 142], [0, 0, 50, 50], [200, 20, 210, 30]], np.float32)  # one whole, one cut, one small
        picture = Picture(image, boxes, np.array([DEER] * 3), [DEER])
        found = cutouts.read_cut_outs([[picture]])
        self.assertEqual({class_id: len(of) for class_id, of in found.items()}, {DEER: 1})
        rgba = found[DEER][0].rgba
        self.assertGreater(rgba[rgba[..., 3] > 0][:, 0].mean(), 200)
        placed = 0
        for index in range(20):
            street = np.full((400, 640, 3), 120, np.uint8)
            taken = np.array([[0, 300, 640, 400]], np.float32)
            boxes, classes = cutouts.put_objects(np.random.default_rng(index), street, found, taken)
            self.assertEqual(len(boxes), len(classes))
            for x1, y1, x2, y2 in boxes:
                self.assertLessEqual(y2, 300)
                self.assertGreater(int(street[int((y1 + y2) / 2), int((x1 + x2) / 2), 0]), 130)
                placed += 1
        self.assertGreater(placed, 5)


class Figures(unittest.TestCase):
    def test_held_out_parts_are_pooled_over_the_sets_that_label_a_class(self):
        class Finds:
            """Finds each square of the picture's number of classes at its place."""

            def detect(self, image):
                found = [np.zeros((0, 5))] * len(CLASSES)
                if image[0, 0, 0]:
                    found[DEER] = np.array([[10, 10, 30, 30, 0.9]])
                    found[MACHINE] = np.array([[0, 0, 30, 30, 0.9]])
                return found

        def picture(value, labelled):
            boxes = np.array([[10, 10, 30, 30]], np.float32)
            return Picture(np.full((40, 40, 3), value, np.uint8), boxes, np.array([DEER]), labelled)

        parts = {"a": [picture(1, [DEER])], "b": [picture(0, [DEER]), picture(1, [DEER, MACHINE])]}
        result = validate_held_out(Finds(), parts, CLASSES)
        self.assertEqual(list(result.pooled), ["deer"])  # no machine is labelled anywhere
        self.assertAlmostEqual(result.pooled["deer"].ap50, 2 / 3)
        self.assertEqual((result.pooled["deer"].labels, result.pooled["deer"].pictures), (3, 3))
        self.assertAlmostEqual(result.by_set["deer"]["b"].ap50, 0.5)

    def test_neither_survey_nor_sets_choose_alone(self):
        pooled = {"pothole": ClassFigure(0.2, 9, 9), "deer": ClassFigure(0.9, 9, 9)}
        self.assertAlmostEqual(selection_figure(HeldOut(pooled, {}), 0.6, 0.3), (0.4 + 0.9 + 0.3) / 3)


if __name__ == "__main__":
    unittest.main()
