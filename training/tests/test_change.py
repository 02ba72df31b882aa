"""Change detection: readers, samples, network, loss and figures on generated pictures."""

import re
import tempfile
import unittest
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import nn

from change import data, registration
from change.augment import Augmenter, Recipe, Sample, Source
from change.classes import CLASSES, COLOURS
from change.data import IGNORED, Pair
from change.inference import fill_invalid
from change.loss import change_loss, class_weights
from change.metrics import PixelCounts
from change.network import ChangeNetwork, ThesisNetwork, Widths, beyond, widened
from change.surroundings import UNSEEN_CHANGE
from common.pasting import CutOut, Ground
from change.paste import paste_pair
from change.validation import registered_pairs, validate

from .synthetic_change import SIGN, VEHICLE, ground, street, write_pair, write_streets

SOURCES = Path(__file__).resolve().parents[2] / "src"


def source_of(seed: int = 1) -> Source:
    """A pair whose pictures lie exactly upon each other."""
    first, second, mask = street(seed, False, True)
    return Source([Pair(first, second, mask, np.eye(3), [])])


class Reading(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = Path(self.folder.name)

    def test_classes_and_colours_are_the_simulators(self):
        described = re.compile(r'\{"(\w+)", \{(\d+), (\d+), (\d+)\}\}')
        found = [described.findall(path.read_text()) for path in sorted(SOURCES.glob("*/change*.cpp"))]
        rows = next(rows for rows in found if rows)
        self.assertEqual(tuple(row[0] for row in rows), CLASSES)
        self.assertEqual(tuple(tuple(map(int, row[1:])) for row in rows), COLOURS)

    def test_masks_of_indices_and_of_published_colours_mean_the_same(self):
        first, second, mask = street(1, False, True)
        write_pair(self.root / "indices", 0, first, second, mask)
        write_pair(self.root / "colours", 0, first, second, mask, coloured=True)
        pairs = data.read_pairs(self.root)
        self.assertEqual(len(pairs), 2)
        np.testing.assert_array_equal(pairs[0].mask, mask)
        np.testing.assert_array_equal(pairs[1].mask, mask)
        np.testing.assert_array_equal(pairs[0].second, second)

    def test_a_few_unknown_colours_are_ignored_and_many_and_an_unknown_index_refused(self):
        path = self.root / "gt00.png"
        mask = np.full((10, 20, 3), 255, np.uint8)
        mask[0, 0] = (1, 2, 3)
        mask[0, 1] = 0
        cv2.imwrite(str(path), mask)
        self.assertEqual((data.read_mask(path) == IGNORED).sum(), 2)
        mask[1, :5] = (1, 2, 3)
        cv2.imwrite(str(path), mask)
        with self.assertRaisesRegex(data.DataError, "6 of 200"):
            data.read_mask(path)
        cv2.imwrite(str(path), np.full((4, 4), 10, np.uint8))
        with self.assertRaisesRegex(data.DataError, "neither a class"):
            data.read_mask(path)

    def test_a_grey_mask_in_three_channels_is_read_where_a_neighbour_has_colours_and_refused_elsewhere(self):
        path = self.root / "gt00.png"
        mask = np.full((10, 20, 3), 255, np.uint8)
        mask[:, 10:] = 0
        for ambiguous in (mask, mask * 0, mask // 255 * 3):
            cv2.imwrite(str(path), ambiguous)
            with self.assertRaisesRegex(data.DataError, "gt00.png has three channels"):
                data.read_mask(path)
        cv2.imwrite(str(path), mask)
        cv2.imwrite(str(self.root / "gt01.png"), np.full((4, 4, 3), (0, 242, 255), np.uint8))
        self.assertEqual((data.read_mask(path) == IGNORED).sum(), 100)

    def test_0_and_255_are_left_out_where_a_neighbour_has_classes(self):
        path = self.root / "gt00.png"
        cv2.imwrite(str(path), np.array([[0, 255]], np.uint8))
        with self.assertRaisesRegex(data.DataError, "change or not"):
            data.read_mask(path)
        cv2.imwrite(str(self.root / "gt01.png"), np.array([[0, 7]], np.uint8))
        np.testing.assert_array_equal(data.read_mask(path), [[0, IGNORED]])

    def test_a_mask_with_transparent_pixels_or_16_bits_is_refused(self):
        path = self.root / "gt00.png"
        cv2.imwrite(str(path), np.zeros((4, 4, 4), np.uint8))
        with self.assertRaisesRegex(data.DataError, "transparent"):
            data.read_mask(path)
        cv2.imwrite(str(path), np.zeros((4, 4), np.uint16))
        with self.assertRaisesRegex(data.DataError, "16 bits"):
            data.read_mask(path)

    def test_miscellaneous_is_rubbish(self):
        path = self.root / "gt00.png"
        cv2.imwrite(str(path), np.full((4, 4, 3), (0, 242, 255), np.uint8))
        self.assertTrue((data.read_mask(path) == CLASSES.index("rubbish")).all())

    def test_a_mask_that_says_change_or_not_is_refused(self):
        path = self.root / "gt00.png"
        cv2.imwrite(str(path), np.array([[0, 255]], np.uint8))
        with self.assertRaisesRegex(data.DataError, "needs classes"):
            data.read_mask(path)

    def test_what_stands_in_a_street_is_known_from_none_and_all(self):
        scenes = data.read_scenes(write_streets(self.root))
        self.assertEqual(len(scenes), 2)
        self.assertEqual(set(np.unique(scenes[0].classes)), {0, SIGN, VEHICLE})
        np.testing.assert_array_equal(scenes[0].image[130, 100], [30, 60, 190])

    def test_registrations_are_kept_by_what_the_pictures_show(self):
        write_streets(self.root / "pairs", (1,))
        cache = self.root / "cache.npz"
        pairs = data.read_pairs(self.root / "pairs", cache)
        register, registration.as_on_board = registration.as_on_board, None  # must not be called again
        try:
            for pair, again in zip(pairs, data.read_pairs(self.root / "pairs", cache)):
                np.testing.assert_array_equal(pair.homography, again.homography)
        finally:
            registration.as_on_board = register
        # Other pictures of the same names, as another rendering leaves them.
        blank = np.full((256, 320, 3), 90, np.uint8)
        write_pair(self.root / "pairs" / "000001" / "some", 0, blank, blank, np.zeros((256, 320), np.uint8))
        self.assertIsNone(data.read_pairs(self.root / "pairs", cache)[-1].homography)
        cache.write_bytes(b"torn")
        with self.assertRaisesRegex(data.DataError, "delete it"):
            data.read_pairs(self.root / "pairs", cache)

    def test_pairs_that_are_registered_already_stay_as_they_are(self):
        write_streets(self.root / "pairs")
        for pair in data.read_pairs(self.root / "pairs", registered=True):
            np.testing.assert_array_equal(pair.homography, np.eye(3))

    def test_an_empty_folder_is_refused(self):
        with self.assertRaisesRegex(data.DataError, "No pair"):
            data.read_pairs(self.root)


class Registering(unittest.TestCase):
    def test_a_shifted_picture_is_found(self):
        image = ground(3)
        shift = np.array([[1, 0, 9.0], [0, 1, -5], [0, 0, 1]])
        found = registration.by_features(image, cv2.warpPerspective(image, shift, (320, 256)))
        np.testing.assert_allclose(found / found[2, 2], shift, atol=0.1)

    def test_edges_find_a_shift_and_a_scale_to_three_pixels(self):
        image = ground(3)
        for scale, right, down in ((1, 9, -5), (1.1, -20, -14), (0.85, 20, 26)):
            onto = np.array([[scale, 0, right], [0, scale, down], [0, 0, 1.0]])
            found = registration.by_edges(image, cv2.warpPerspective(image, onto, (320, 256)))
            self.assertIsNotNone(found, f"scale {scale}")
            corners = np.float32([[[40, 40]], [[280, 40]], [[40, 210]], [[280, 210]]])
            places = [cv2.perspectiveTransform(corners, homography) for homography in (found, onto)]
            self.assertLess(np.abs(places[0] - places[1]).max(), 3, f"scale {scale}")

    def test_what_does_not_match_is_refused(self):
        for register in (registration.by_features, registration.by_edges):
            self.assertIsNone(register(ground(3), np.full((256, 320, 3), 90, np.uint8)))
            for seed in range(10, 14):
                self.assertIsNone(register(ground(3), ground(seed)))

    def test_a_wall_seen_from_nearer_is_larger_about_the_middle(self):
        intrinsics = registration.camera_matrix(300, 300, 160, 128)
        nearer = np.array([0, 0, 5.0, 0, 0, 0, 1])
        found = registration.by_plane(np.array([0, 0, 0, 0, 0, 0, 1.0]), nearer, intrinsics, 10)
        np.testing.assert_allclose(found @ [160, 128, 1] / (found @ [160, 128, 1])[2], [160, 128, 1])
        np.testing.assert_allclose(found @ [190, 128, 1] / (found @ [190, 128, 1])[2], [220, 128, 1])


class Samples(unittest.TestCase):
    def draw(self, seed=5, source=None, **changes) -> Sample:
        return Augmenter(source or source_of(), Recipe(**changes)).draw(np.random.default_rng(seed))

    def test_depend_on_their_seed_alone(self):
        one, other = self.draw(), self.draw()
        for name in ("first", "second", "mask"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))

    def test_a_swapped_pair_has_the_same_truth(self):
        kept, swapped = self.draw(swap=0.0), self.draw(swap=1.0)
        np.testing.assert_array_equal(kept.first, swapped.second)
        np.testing.assert_array_equal(kept.second, swapped.first)
        np.testing.assert_array_equal(kept.mask, swapped.mask)

    def test_one_picture_twice_has_no_change_and_two_lights(self):
        for seed in range(5):
            sample = self.draw(seed, identical=1.0)
            self.assertFalse(((sample.mask != 0) & (sample.mask != IGNORED)).any())
            self.assertTrue((sample.first != sample.second).any())

    def test_both_pictures_and_the_truth_are_moved_alike(self):
        for seed in range(5):
            sample = self.draw(seed, identical=0.0, swap=0.0, season=0.0, misaligned_px=0.0)
            differ = (np.abs(sample.first.astype(int) - sample.second) > 60).any(axis=2)
            changed = (sample.mask != 0) & (sample.mask != IGNORED)
            self.assertGreater(changed.sum(), 100)
            self.assertGreater((differ & changed).sum(), 0.7 * changed.sum())
            self.assertLess((differ & ~changed).sum(), 0.1 * changed.sum())

    def test_where_the_warp_had_nothing_both_pictures_are_the_same_and_nothing_is_judged(self):
        first, second, mask = street(1, False, True)
        away = np.array([[1, 0, 100.0], [0, 1, 0], [0, 0, 1]])
        source = Source([Pair(first, second, mask, away, [])])
        sample = self.draw(source=source, identical=0.0, scale=(1.0, 1.0), width=320, height=256, focus=0.0)
        ignored = sample.mask == IGNORED
        self.assertGreater(ignored.mean(), 0.25)
        np.testing.assert_array_equal(sample.first[ignored], sample.second[ignored])

    def test_fill(self):
        validity = np.array([[1, 0]], np.uint8)
        filled = fill_invalid(np.full((1, 2, 3), 7, np.uint8), np.full((1, 2, 3), 9, np.uint8), validity)
        np.testing.assert_array_equal(filled[0, :, 0], [7, 9])

    def test_pasted_objects_change_what_the_mask_says(self):
        cut_outs = {SIGN: [CutOut(np.full((80, 20, 4), 255, np.uint8), SIGN)]}
        seen = 0
        for seed in range(8):
            first, second, mask = paste_pair(np.random.default_rng(seed), np.full((200, 300, 3), 40, np.uint8), "streets", cut_outs)
            bright = [(picture > 120).all(axis=2) for picture in (first, second)]
            self.assertEqual(set(np.unique(mask)) - {0, SIGN}, set())
            # Shadows under the objects are no change; where only one picture shows a sign, there is one.
            np.testing.assert_array_equal(mask[bright[0] != bright[1]], SIGN)
            self.assertFalse(mask[~bright[0] & ~bright[1]].any())
            seen += mask.any()
        self.assertGreater(seen, 3)

    def test_objects_grow_towards_the_camera(self):
        road = Ground(horizon_px=100, camera_m=1.5)
        self.assertAlmostEqual(road.height_px(1.5, 160), 60)
        self.assertAlmostEqual(road.height_px(0.75, 220), 60)


class Networks(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(1)
        self.network = ChangeNetwork().eval()
        self.pictures = torch.randn(2, 1, 3, 64, 96)

    def test_change_small_is_small(self):
        self.assertLess(sum(parameter.numel() for parameter in self.network.parameters()), 2_000_000)

    def test_logits_pass_no_relu(self):
        for network in (self.network, ThesisNetwork(base=4).eval()):
            self.assertIsInstance(list(network.final.modules())[-1], nn.Conv2d)
            with torch.no_grad():
                logits = network(*self.pictures)
            self.assertLess(logits.min().item(), 0)
            self.assertGreater(logits.max().item(), 0)

    def test_both_networks_give_a_probability_for_every_pixel(self):
        for network in (self.network, ThesisNetwork(base=4).eval()):
            with torch.no_grad():
                found = network.detect(*self.pictures, torch.ones(1, 1, 64, 96))
            self.assertEqual(tuple(found.shape), (1, len(CLASSES), 64, 96))
            torch.testing.assert_close(found.sum(dim=1), torch.ones(1, 64, 96))

    def test_decoders_have_weights_of_their_own_until_pretraining_is_over(self):
        weight = "joins.0.0.weight"
        self.assertFalse(torch.equal(self.network.first.state_dict()[weight], self.network.second.state_dict()[weight]))
        self.network.begin_changes()
        self.assertTrue(torch.equal(self.network.first.state_dict()[weight], self.network.second.state_dict()[weight]))

    def test_kept_features_give_the_same_as_pictures(self):
        validity = torch.ones(1, 1, 64, 96)
        with torch.no_grad():
            kept = self.network.encode(self.pictures[0])
            at_once = self.network.detect(*self.pictures, validity)
            torch.testing.assert_close(self.network.probabilities(kept, self.network.encode(self.pictures[1]), validity), at_once)

    def test_what_is_only_shifted_is_not_beyond(self):
        features = torch.rand(1, 4, 12, 16)
        inner = (..., slice(3, -3), slice(3, -3))
        self.assertEqual(beyond(features, features.roll((2, -2), (2, 3)), 5)[inner].max().item(), 0)
        self.assertGreater(beyond(features, features.roll((3, 0), (2, 3)), 5)[inner].max().item(), 0)
        apart = beyond(features + 2, features, 5)
        self.assertGreater(apart.min().item(), 1, "brighter than all that is near")
        torch.testing.assert_close(beyond(-features - 2, -features, 5), apart)

    def test_a_widened_network_begins_as_the_narrower_one_ended(self):
        narrow = ChangeNetwork(Widths(windows=(0, 0, 0, 0))).eval()
        self.network.load_state_dict(widened(narrow.state_dict(), self.network))
        with torch.no_grad():
            torch.testing.assert_close(self.network(*self.pictures), narrow(*self.pictures))
        with self.assertRaises(RuntimeError):
            self.network.load_state_dict(widened(ThesisNetwork(base=4).state_dict(), self.network))

    def test_of_what_was_not_seen_the_pictures_say_nothing(self):
        nn.init.constant_(self.network.final[-1].bias, 0)
        with torch.no_grad():
            self.network.final[-1].bias[VEHICLE] = 50  # sure of a vehicle everywhere
            validity = torch.ones(1, 1, 64, 96)
            validity[..., 10:21, 30:51] = 0
            found = self.network.detect(*self.pictures, validity)
        no_change = found[0, 0]
        torch.testing.assert_close(no_change[10:21, 30:51], torch.full((11, 21), 1 - UNSEEN_CHANGE))
        # Not much more than that: two pixels beyond.
        self.assertLess(no_change[:7].max().item(), 1e-6)
        self.assertLess(no_change[24:].max().item(), 1e-6)
        self.assertLess(no_change[:, :27].max().item(), 1e-6)


class Losses(unittest.TestCase):
    def test_ignored_pixels_do_not_count(self):
        torch.manual_seed(1)
        logits, masks = torch.randn(1, 10, 8, 8), torch.randint(0, 10, (1, 16, 16))
        masks[:, :8] = IGNORED
        weights = torch.ones(10)
        changed = logits.clone()
        changed[:, :, :4] += torch.randn(1, 10, 4, 8)
        self.assertAlmostEqual(change_loss(logits, masks, weights).item(), change_loss(changed, masks, weights).item(), places=5)

    def test_is_least_for_the_truth(self):
        masks = torch.zeros(1, 8, 8, dtype=torch.int64)
        masks[:, 2:6, 2:6] = 7
        right = 20 * nn.functional.one_hot(masks[:, ::2, ::2], 10).permute(0, 3, 1, 2).float()
        self.assertLess(change_loss(right, masks, torch.ones(10)).item(), 0.02)
        self.assertGreater(change_loss(torch.zeros_like(right), masks, torch.ones(10)).item(), 1)

    def test_rare_classes_weigh_more(self):
        mask = np.zeros((100, 100), np.uint8)
        mask[:40], mask[99, 90:] = 9, 3
        weights = class_weights([mask])
        self.assertEqual(weights[0], 1)
        self.assertGreater(weights[3], weights[9])

    def test_training_lowers_it(self):
        torch.manual_seed(1)
        network = ChangeNetwork().train()
        augmenter = Augmenter(source_of(), Recipe(width=128, height=96, identical=0.0, season=0.0))
        drawn = [augmenter.draw(np.random.default_rng(seed)) for seed in range(4)]
        first, second = (
            torch.from_numpy(np.stack([getattr(sample, name) for sample in drawn])).permute(0, 3, 1, 2).float() / 58 - 2
            for name in ("first", "second")
        )
        masks = torch.from_numpy(np.stack([sample.mask for sample in drawn]).astype(np.int64))
        optimizer = torch.optim.AdamW(network.parameters(), 3e-3)
        losses = []
        for _ in range(12):
            loss = change_loss(network(first, second), masks, torch.ones(10))
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        self.assertLess(losses[-1], 0.5 * losses[0])


class Figures(unittest.TestCase):
    def counts(self):
        """100 unchanged pixels, 4 of them at 0.9, 10 changed ones, 8 of them above."""
        mask, probabilities = np.zeros(110, np.uint8), np.zeros((10, 110))
        mask[100:] = VEHICLE
        probabilities[VEHICLE] = 0.1
        probabilities[VEHICLE, :4] = 0.9
        probabilities[VEHICLE, 100:108] = 0.95
        probabilities[SIGN, 100:102], probabilities[VEHICLE, 100:102] = 0.95, 0
        probabilities[0] = 1 - probabilities[1:].sum(axis=0)
        counts = PixelCounts()
        counts.add(probabilities[:, None], mask[None])
        return counts

    def test_at_a_false_positive_rate(self):
        counts = self.counts()
        self.assertEqual(counts.at_false_positive_rate(0.01)["recall"], 0.8)
        self.assertEqual(counts.at_false_positive_rate(0.01)["precision"], 1)
        at_four = counts.at_false_positive_rate(0.04)
        self.assertAlmostEqual(at_four["precision"], 8 / 12)
        self.assertTrue(0.1 < at_four["threshold"] <= 0.9)

    def test_of_the_best_class(self):
        figures = self.counts().best_class_figures()
        self.assertAlmostEqual(figures["recall"], 0.8)
        self.assertAlmostEqual(figures["multi_class"], 6 / 8)
        self.assertAlmostEqual(figures["false_positive_rate"], 0.04)
        self.assertAlmostEqual(figures["binary_accuracy"], 104 / 110)
        self.assertAlmostEqual(figures["changed_share"], 10 / 110)

    def test_ignored_pixels_are_left_out(self):
        counts = PixelCounts()
        counts.add(np.full((10, 1, 3), 0.1), np.array([[IGNORED, 0, 5]], np.uint8))
        self.assertEqual(counts.confusion.sum(), 2)
        self.assertEqual(counts.scores.sum(), 2)

    def test_validation_measures_order_and_identity_too(self):
        with tempfile.TemporaryDirectory() as folder:
            pairs = registered_pairs(data.read_pairs(write_streets(Path(folder))))
        self.assertEqual(sorted(pair.part for pair in pairs), ["changes"] * 2 + ["unchanged"] * 2)

        def difference(first, second, _):
            """Any difference is a vehicle that came."""
            found = np.zeros((10, 256, 320), np.float32)
            found[VEHICLE] = np.abs(first.astype(int) - second).max(axis=2) > 60
            found[0] = 1 - found[VEHICLE]
            return found

        figures = validate(difference, pairs).figures()
        self.assertGreater(figures["changes_f1_at_0.01"], 0.8)
        self.assertAlmostEqual(figures["changes_f1_at_0.01"], figures["reversed_f1_at_0.01"], places=6)
        self.assertTrue(0.4 < figures["changes_multi_class"] < 0.9)
        self.assertLess(figures["unchanged_fpr"], 0.01)
        self.assertIn("identical_fpr", figures)


if __name__ == "__main__":
    unittest.main()
