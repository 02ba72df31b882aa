"""How a pair reaches the network: size, padding, normalisation, and what stands where the warp had nothing."""

import numpy as np

from detector.inference import letterbox as letterbox_to

MEAN, STD = 114.0, 58.0
"""Normalisation of all channels: (pixel - MEAN) / STD, pixel 0..255."""

PAD_VALUE = 114
INPUT_WIDTH, INPUT_HEIGHT = 320, 256


def letterbox(image: np.ndarray) -> np.ndarray:
    """An H x W x 3 picture scaled to fit the network's input, padded on the right and at the bottom."""
    return letterbox_to(image, INPUT_WIDTH, INPUT_HEIGHT)[0]


def normalise(image: np.ndarray) -> np.ndarray:
    """H x W x 3 uint8 to 3 x H x W float32."""
    return np.ascontiguousarray(((image.astype(np.float32) - MEAN) / STD).transpose(2, 0, 1))


def fill_invalid(warped: np.ndarray, other: np.ndarray, validity: np.ndarray) -> np.ndarray:
    """The warped picture with the other's pixels where the warp had nothing (validity 0), so that no edge stands there."""
    return np.where(validity[..., None] > 0, warped, other)
