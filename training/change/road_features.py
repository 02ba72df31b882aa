"""What the road look compares: a detector's features at stride 8, each channel in units of its deviation on road photos.

A detector that has learnt what lies on roads describes things by what they are, and the bare road, its paint and its shadows by
little. Where two such descriptions of a road differ, something lies there or lay there.
"""

import warnings
from pathlib import Path
from typing import Sequence

import cv2
import numpy as np
import onnx
import torch
from torch import Tensor, nn

from common.files import DataError
from detector.network import SIZES, Detector
from detector.onnx_model import for_opencv, fuse_batch_norms
from detector.pretrained import ConversionError, load_exported

from .inference import normalise

WIDTH, HEIGHT = 640, 224
"""Of the graph's input."""

BAND = (0.366, 0.967)
"""Rows of a picture that are looked at, as shares of its height; src/change/methods/road_look.cpp has the same."""

LEAST_DEVIATION = 0.03
"""A channel that is nearly constant is not blown up."""

OUTPUT = "features"
OPSET = 13


class RoadFeatures(nn.Module):
    """B x 3 x H x W normalised RGB to B x C x H/8 x W/8: the middle level of a detector's pyramid over `deviations` (C)."""

    def __init__(self, detector: Detector, deviations: Tensor):
        super().__init__()
        self.detector = detector
        self.register_buffer("scale", (1 / deviations.clamp(min=LEAST_DEVIATION))[None, :, None, None])

    def forward(self, image: Tensor) -> Tensor:
        return self.detector.pyramid(self.detector.backbone(image))[1] * self.scale


def read_detector(path: Path, class_count: int = 8, size: str = "medium") -> Detector:
    """An exported detector as a network, for inference."""
    detector = Detector(class_count, SIZES[size]).eval()
    try:
        load_exported(detector, path)
    except ConversionError as error:
        raise DataError(str(error)) from error
    fuse_batch_norms(detector)
    return detector.eval()


def prepared(image: np.ndarray) -> np.ndarray:
    """The band of an H x W x 3 RGB picture, scaled to fit, padded right and at the bottom, normalised: 3 x HEIGHT x WIDTH."""
    height = image.shape[0]
    band = image[round(BAND[0] * height) : round(BAND[1] * height)]
    scale = min(WIDTH / band.shape[1], HEIGHT / band.shape[0])
    size = round(band.shape[1] * scale), round(band.shape[0] * scale)
    fitted = np.full((HEIGHT, WIDTH, 3), 114, np.uint8)
    fitted[: size[1], : size[0]] = cv2.resize(band, size, interpolation=cv2.INTER_LINEAR)
    return normalise(fitted)


@torch.no_grad()
def deviations_on(detector: Detector, photos: Sequence[np.ndarray]) -> Tensor:
    """Of each channel over all cells of all photos (H x W x 3 RGB)."""
    plain = RoadFeatures(detector, torch.ones(SIZES["medium"].pyramid[1]))
    cells = [plain(torch.from_numpy(prepared(photo))[None])[0].flatten(1) for photo in photos]
    return torch.cat(cells, dim=1).std(dim=1)


def export(features: RoadFeatures, path: Path) -> None:
    """Write the graph: `image` to `features`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", torch.jit.TracerWarning)  # sizes are compared while tracing: the graph's are fixed
        torch.onnx.export(
            features, torch.zeros(1, 3, HEIGHT, WIDTH), str(path), opset_version=OPSET, input_names=["image"], output_names=[OUTPUT],
        )
    onnx.save(for_opencv(onnx.load(str(path))), str(path))
