"""What the road look is given: the band of a picture, and features in units of their deviation."""

import unittest

import numpy as np
import torch

from change import road_features
from change.inference import normalise
from detector.network import SIZES, Detector


class RoadFeaturesTest(unittest.TestCase):
    def test_the_band_is_scaled_to_fit_and_padded_at_the_bottom(self):
        picture = np.zeros((480, 960, 3), np.uint8)
        picture[176:464] = 200
        prepared = road_features.prepared(picture)
        self.assertEqual(prepared.shape, (3, road_features.HEIGHT, road_features.WIDTH))
        band, padding = (normalise(np.full((1, 1, 3), value, np.uint8))[0, 0, 0] for value in (200, 114))
        self.assertTrue(np.allclose(prepared[:, :192], band))
        self.assertTrue(np.allclose(prepared[:, 192:], padding))

    def test_features_are_the_pyramids_middle_level_over_their_deviations(self):
        torch.manual_seed(1)
        detector = Detector(8, SIZES["medium"]).eval()
        channels = SIZES["medium"].pyramid[1]
        deviations = torch.full((channels,), 0.5)
        deviations[0] = 0.0  # of a channel that never changes
        image = torch.randn(1, 3, 64, 96)
        with torch.no_grad():
            plain = detector.pyramid(detector.backbone(image))[1]
            found = road_features.RoadFeatures(detector, deviations)(image)
        self.assertEqual(tuple(found.shape), (1, channels, 8, 12))
        self.assertTrue(torch.allclose(found[:, 1:], plain[:, 1:] * 2))
        self.assertTrue(torch.allclose(found[:, :1], plain[:, :1] / road_features.LEAST_DEVIATION))


if __name__ == "__main__":
    unittest.main()
