"""How a pair reaches the network: size, padding, normalisation, and what stands where the warp had nothing."""

import numpy as np

from detector import inference

MEAN, STD, PAD_VALUE = inference.MEAN, inference.STD, inference.PAD_VALUE
normalise = inference.normalise
"""As in the detector."""

INPUT_WIDTH, INPUT_HEIGHT = 320, 256


def letterbox(image: np.ndarray) -> np.ndarray:
    """An H x W x 3 picture scaled to fit the network's input, padded on the right and at the bottom."""
    return inference.letterbox(image, INPUT_WIDTH, INPUT_HEIGHT)[0]


def fill_invalid(warped: np.ndarray, other: np.ndarray, validity: np.ndarray) -> np.ndarray:
    """The warped picture with the other's pixels where the warp had nothing (validity 0), so that no edge stands there."""
    return np.where(validity[..., None] > 0, warped, other)
