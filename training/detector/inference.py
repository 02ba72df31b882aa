"""From a picture to detections, as the vehicle does it: letterbox, network, decode, suppression."""

from dataclasses import dataclass
from typing import List, Sequence, Tuple

import cv2
import numpy as np

from .boxes import clip_to_image, non_maximum_suppression, pairwise_iou
from .network import STRIDES

MEAN, STD = 114.0, 58.0
"""Normalisation of all channels: (pixel - MEAN) / STD, pixel 0..255."""

PAD_VALUE = 114
LOWEST_SCORE = 0.05
NMS_IOU = 0.5
MOST_CANDIDATES = 3000
"""Per class, only this many of the best enter the suppression, as in the vehicle."""

INPUT_WIDTH, INPUT_HEIGHT = 640, 400


@dataclass(frozen=True)
class ViewConfig:
    """How a network looks at a picture."""

    width: int = INPUT_WIDTH  # of its input
    height: int = INPUT_HEIGHT
    scales: Tuple[float, ...] = (1.0,)  # of the views within its graph
    mirrored: bool = False  # at the mirrored picture too


def letterbox_scale(image_width: int, image_height: int, width: int, height: int) -> float:
    """How much larger a picture becomes where it is fitted into width x height."""
    return min(width / image_width, height / image_height)


def letterbox(image: np.ndarray, width: int, height: int) -> Tuple[np.ndarray, float]:
    """Scale an H x W x 3 picture to fit, pad right and bottom; returns the picture and the scale."""
    scale = letterbox_scale(image.shape[1], image.shape[0], width, height)
    fitted = (round(image.shape[1] * scale), round(image.shape[0] * scale))
    if fitted != (image.shape[1], image.shape[0]):
        image = cv2.resize(image, fitted, interpolation=cv2.INTER_LINEAR)
    right, bottom = width - fitted[0], height - fitted[1]
    if right or bottom:
        image = cv2.copyMakeBorder(image, 0, bottom, 0, right, cv2.BORDER_CONSTANT, value=(PAD_VALUE,) * 3)
    return image, scale


def normalise(image: np.ndarray) -> np.ndarray:
    """H x W x 3 uint8 to 3 x H x W float32."""
    return np.ascontiguousarray(((image.astype(np.float32) - MEAN) / STD).transpose(2, 0, 1))


FUSION_IOU = 0.5
"""Of two views' boxes, from which on they are of one object."""


def strides_of(scales: Sequence[float]) -> List[int]:
    """Pixels of the input per cell, level by level of each view: seen at half the size, a stride of 4 is 8 pixels."""
    return [round(stride / scale) for scale in scales for stride in STRIDES]


@dataclass(frozen=True)
class AnchorGrid:
    """Where the rows of the network's output lie in the picture."""

    cells: np.ndarray  # N x 2: grid_x, grid_y
    strides: np.ndarray  # N x 1
    view_ends: Tuple[int, ...] = ()  # row behind each view's last one

    @staticmethod
    def of(width: int, height: int, scales: Tuple[float, ...] = (1.0,)) -> "AnchorGrid":
        """All anchor points: views in the order of their scales, levels in that of the strides, rows first."""
        cells, strides, ends = [], [], []
        for stride in strides_of(scales):
            rows, columns = np.mgrid[: height // stride, : width // stride]
            cells.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
            strides.append(np.full((rows.size, 1), stride))
            if len(strides) % len(STRIDES) == 0:
                ends.append(sum(map(len, strides)))
        return AnchorGrid(np.concatenate(cells).astype(np.float32), np.concatenate(strides).astype(np.float32), tuple(ends))


def decode_views(
    raw_boxes: np.ndarray, scores: np.ndarray, grid: AnchorGrid, scale: float, image_size: Tuple[int, int],
    nms_iou: float = NMS_IOU,
) -> List[List[np.ndarray]]:
    """Raw boxes (N x 4: tx, ty, tw, th) and scores (N x C) to M x 5 detections per view and class.

    `scale` is the letterbox's; `image_size` is (width, height) of the picture, to which boxes are cut.
    """
    views, begin = [], 0
    for end in grid.view_ends:
        view = AnchorGrid(grid.cells[begin:end], grid.strides[begin:end])
        views.append(decode_view(raw_boxes[begin:end], scores[begin:end], view, scale, image_size, nms_iou))
        begin = end
    return views


def fuse_views(views: List[List[np.ndarray]]) -> List[np.ndarray]:
    """Detections per view and class to such per class."""
    return views[0] if len(views) == 1 else [fuse(of_class) for of_class in zip(*views)]


def mirrored_boxes(detections: np.ndarray, width: float) -> np.ndarray:
    """Detections (M x 5) in a mirrored picture of that width, in pixels of the picture itself."""
    return np.hstack([width - detections[:, 2:3], detections[:, 1:2], width - detections[:, 0:1], detections[:, 3:]])


def fuse(views: Sequence[np.ndarray]) -> np.ndarray:
    """Detections (M x 5) of one class in several views to M x 5, as the vehicle does it (weighted boxes fusion)."""
    rows = np.concatenate([np.hstack([found, np.full((len(found), 1), view)]) for view, found in enumerate(views)])
    rows = rows[np.argsort(-rows[:, 4], kind="stable")]
    free, fused = np.ones(len(rows), bool), []
    for index, row in enumerate(rows):
        if not free[index]:
            continue
        same = free & (pairwise_iou(row[None, :4], rows[:, :4])[0] >= FUSION_IOU)
        same[index] = True
        free &= ~same
        best = [rows[same & (rows[:, 5] == view)][0] for view in range(len(views)) if (same & (rows[:, 5] == view)).any()]
        weights = np.array([one[4] for one in best])
        box = (np.array([one[:4] for one in best]) * weights[:, None]).sum(axis=0) / weights.sum()
        fused.append([*box, weights.sum() / len(views)])
    fused = np.array(fused, np.float32).reshape(-1, 5)
    return fused[np.argsort(-fused[:, 4], kind="stable")]


def decode_view(
    raw_boxes: np.ndarray, scores: np.ndarray, grid: AnchorGrid, scale: float, image_size: Tuple[int, int], nms_iou: float,
) -> List[np.ndarray]:
    """The same of one view alone."""
    detections = []
    for class_scores in scores.T:
        rows = np.argsort(-class_scores, kind="stable")[:MOST_CANDIDATES]
        rows = rows[class_scores[rows] >= LOWEST_SCORE]
        raw, cells, strides = raw_boxes[rows], grid.cells[rows], grid.strides[rows]
        centres = (raw[:, :2] + cells) * strides
        half_sizes = 0.5 * np.exp(np.minimum(raw[:, 2:4], 8)) * strides
        boxes = clip_to_image(np.hstack([centres - half_sizes, centres + half_sizes]) / scale, *image_size)
        kept = non_maximum_suppression(boxes, class_scores[rows], nms_iou)
        detections.append(np.hstack([boxes[kept], class_scores[rows][kept, None]]))
    return detections
