"""Box arithmetic in numpy. Boxes are rows of corners (x1, y1, x2, y2) in pixels."""

import numpy as np


def areas(boxes: np.ndarray) -> np.ndarray:
    """N x 4 boxes to N areas; a box without extent has none."""
    return np.clip(boxes[:, 2] - boxes[:, 0], 0, None) * np.clip(boxes[:, 3] - boxes[:, 1], 0, None)


def pairwise_iou(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """N x 4 and M x 4 boxes to N x M intersections over unions."""
    left_top = np.maximum(first[:, None, :2], second[None, :, :2])
    right_bottom = np.minimum(first[:, None, 2:4], second[None, :, 2:4])
    intersection = np.clip(right_bottom - left_top, 0, None).prod(axis=2)
    union = areas(first)[:, None] + areas(second)[None, :] - intersection
    return intersection / np.maximum(union, 1e-9)


def non_maximum_suppression(boxes: np.ndarray, scores: np.ndarray, iou_limit: float) -> np.ndarray:
    """Indices of the boxes that no better kept box overlaps by more than iou_limit, best first."""
    order = np.argsort(-scores, kind="stable")
    kept = []
    while order.size:
        best, order = order[0], order[1:]
        kept.append(best)
        if order.size:
            order = order[pairwise_iou(boxes[best : best + 1], boxes[order])[0] <= iou_limit]
    return np.array(kept, dtype=np.int64)


def clip_to_image(boxes: np.ndarray, width: float, height: float) -> np.ndarray:
    """A copy of the boxes cut to the image."""
    clipped = boxes.copy()
    clipped[:, 0::2] = clipped[:, 0::2].clip(0, width)
    clipped[:, 1::2] = clipped[:, 1::2].clip(0, height)
    return clipped
