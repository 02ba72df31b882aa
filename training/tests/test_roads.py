"""Pairs of street photos: what comes and goes is in the mask, what only moves is not, and the measured pairs stay out."""

import tempfile
import unittest
from pathlib import Path

import cv2
import numpy as np
import torch
import yaml

import train_change
from change import data, roads
from change.augment import Augmenter, Recipe, Source
from change.classes import CLASSES
from change.exported import hold_normalisation
from change.network import ChangeNetwork
from common.pasting import CutOut
from common.training import UsageError

from .synthetic import write_sets
from .synthetic_change import ground

CONE = CLASSES.index("traffic_cone")


def photo(seed: int) -> roads.RoadPhoto:
    """A street with texture and no hazard."""
    return roads.RoadPhoto(ground(seed, (640, 320)), np.zeros((0, 4), np.float32))


def some_roads(places=()) -> roads.Roads:
    """Two photos and a red thing."""
    thing = np.dstack([np.full((40, 30, 3), (200, 20, 20), np.uint8), np.full((40, 30), 255, np.uint8)])
    return roads.Roads([photo(1), photo(2)], {CONE: [CutOut(thing, CONE)]}, list(places))


class Pairs(unittest.TestCase):
    def test_they_depend_on_the_seed_alone_and_differ_where_the_mask_says(self):
        source = some_roads()
        changed = 0
        for seed in range(12):
            first, second, mask = source.draw(np.random.default_rng(seed))
            for one, other in zip((first, second, mask), source.draw(np.random.default_rng(seed))):
                np.testing.assert_array_equal(one, other)
            self.assertEqual(first.shape[:2], mask.shape)
            self.assertEqual(first.shape, second.shape)
            self.assertNotIn(data.IGNORED, mask, "of one photo everything is known")
            there = mask > 0
            changed += int(there.any())
            if there.sum() > 50:
                apart = np.abs(first.astype(int) - second).mean(axis=2)
                self.assertGreater(apart[there].mean(), apart[~there].mean())
        self.assertGreater(changed, 6)

    def test_of_two_photos_of_a_place_hazards_that_stand_there_are_ignored(self):
        standing = roads.RoadPhoto(ground(1, (640, 320)), np.array([[300, 200, 340, 230]], np.float32))
        source = roads.Roads([standing, photo(1)], {}, [roads.PlacePair(0, 1, np.eye(3))])
        pictures, ignored, flow = None, None, 0
        for seed in range(20):
            pictures, ignored, flow, _ = source.draw_views(np.random.default_rng(seed))
            if flow is None:
                break
        self.assertIsNone(flow)
        self.assertEqual((ignored[215, 320], ignored[250, 320], ignored[20, 320]), (1, 0, 1))
        np.testing.assert_array_equal(*pictures)

    def test_photos_of_one_place_are_found_and_others_are_not(self):
        here = photo(1)
        moved = roads.RoadPhoto(cv2.warpAffine(here.image, np.float32([[1, 0, 7], [0, 1, -4]]), (640, 320)), here.boxes)
        (found,) = roads.places_in([photo(3), here, moved], 10)
        self.assertEqual((found.first, found.second), (11, 12))
        np.testing.assert_allclose(found.homography, [[1, 0, 7], [0, 1, -4], [0, 0, 1]], atol=0.3)

    def test_samples_are_drawn_of_roads_alone(self):
        sample = Augmenter(Source([], roads=some_roads()), Recipe()).draw(np.random.default_rng(3))
        self.assertEqual((sample.first.shape, sample.mask.shape), ((192, 224, 3), (192, 224)))


class Files(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = Path(self.folder.name)

    def test_the_real_pairs_are_cut_in_two_halves_by_place(self):
        kept_set, names = roads.pictures_of_pairs(train_change.PAIRS_KEPT_APART)
        self.assertEqual((kept_set, len(names), names[0]), ("debris_lostandfound", 21, "laf_004"))
        content = yaml.safe_load(train_change.PAIRS_KEPT_APART.read_text())
        halves = [{number for pair in content[part] for number in pair.split("_")} for part in ("looked_at", "measured_once")]
        self.assertEqual([len(content[part]) for part in ("looked_at", "measured_once")], [7, 7])
        self.assertFalse(halves[0] & halves[1], "a picture shows one place")

    def test_pictures_of_the_pairs_and_held_out_ones_are_not_trained_on(self):
        catalogue, pairs = write_sets(self.root), self.root / "pairs.yaml"
        pairs.write_text('set: cattle\npicture: street1-\nlooked_at: []\nmeasured_once: ["2_3"]\n')
        found = roads.read_roads(self.root, catalogue, pairs)
        self.assertEqual(len(found.photos), 1, "street1-2 makes a pair, street2-* is held out")
        pairs.write_text("set: cattle\n")
        with self.assertRaisesRegex(data.DataError, "pairs.yaml"):
            roads.read_roads(self.root, catalogue, pairs)


class Refining(unittest.TestCase):
    def test_a_finished_network_trains_without_measuring_its_normalisation_anew(self):
        network = ChangeNetwork(refiners=2)
        settings = train_change.Settings(pretrain=0, epochs=1, samples_per_epoch=4, batch=2, refine=True)
        trainer = train_change.Trainer(settings, torch.device("cpu"), network)
        before = {name: value.clone() for name, value in trainer.model.state_dict().items()}
        trainer.train_epoch(Source([], roads=some_roads()), 0)
        changed = {name for name, value in trainer.model.state_dict().items() if not torch.equal(value, before[name])}
        self.assertIn("final.2.weight", changed)
        self.assertIn("surroundings.refiners.1.correction.weight", changed)
        self.assertFalse(any("running" in name for name in changed))
        network.train()
        hold_normalisation(network)
        self.assertFalse(network.final[0][1].training)
        self.assertTrue(network.surroundings.refiners[0].hidden.training)

    def test_its_flags_go_together(self):
        for flags, said in (
            (["--refine", "--pretrain", "0"], "--start-from"), (["--refine", "--start-from", "a.pt"], "--pretrain 0"),
            (["--start-from", "a.onnx"], "--refine"), (["--sets", "sets.yaml"], "--data"),
        ):
            with self.assertRaisesRegex(UsageError, said):
                train_change.settings_from(train_change.parse_arguments(flags))


if __name__ == "__main__":
    unittest.main()
