"""Hazards cut out of the photos of the sets, to stand on the roads of other photos, as far away as the road goes.

The photos of most sets are taken from near, beside the road or without one. A driver's camera sees the same things
small, on a road ahead.
"""

from typing import Dict, List, Optional, Sequence, Tuple

import cv2
import numpy as np

from common.pasting import BLOCK, CONE, CutOut, Ground, cast_contact_shadow, cut_box, paste

from . import CLASSES
from .data import Picture

HEIGHTS_M = {
    "traffic_cone": 0.7, "barrier": 1.2, "debris": 0.4, "deer": 1.2, "construction_machine": 2.8, "stopped_accident": 1.5,
}
"""Typical height by class; other classes are not cut out."""

LEAST_PX, WORKING_PX = 24, 112
"""A box must be so wide and high; a larger one is shrunk to the second before it is cut out."""

SHARES = (0.3, 0.95)
"""How much of its box a cut-out object fills."""

MOST_CUT_OUTS = 150
"""Of one class and set: the first ones by name."""

MOST_OBJECTS = 3
CAMERA_M = (1.2, 2.2)
HORIZON = (0.38, 0.55)
"""Heights of the camera, and rows of the horizon in fractions of the picture, that a street photo may have."""

LEAST_HEIGHT_PX, MOST_ENLARGED = 6.0, 1.6


def is_cut_by_border(box: np.ndarray, width: int, height: int) -> bool:
    """Whether a box touches the picture's border: a part of the object may be missing."""
    return bool(box[0] < 2 or box[1] < 2 or box[2] > width - 2 or box[3] > height - 2)


def cut_out(picture: Picture, box: np.ndarray, class_id: int) -> Optional[CutOut]:
    """One object without what is around it; None where it cannot be told from that."""
    height, width = picture.image.shape[:2]
    size = box[2:] - box[:2]
    if size.min() < LEAST_PX or is_cut_by_border(box, width, height):
        return None
    scale = min(WORKING_PX / size.max(), 1.0)
    image = cv2.resize(picture.image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    rgba = cut_box(image, box * scale, CONE if CLASSES[class_id] == "traffic_cone" else BLOCK, SHARES)
    if not rgba.size:
        return None
    rows, columns = (np.flatnonzero((rgba[..., 3] > 0).any(axis=axis)) for axis in (1, 0))
    if rows[-1] - rows[0] < 0.75 * rgba.shape[0] or columns[-1] - columns[0] < 0.75 * rgba.shape[1]:
        return None  # a part of it, most likely
    return CutOut(np.ascontiguousarray(rgba[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]), class_id)


def read_cut_outs(groups: Sequence[List[Picture]]) -> Dict[int, List[CutOut]]:
    """Objects by class, of the training parts of the sets."""
    found: Dict[int, List[CutOut]] = {}
    wanted = {CLASSES.index(name) for name in HEIGHTS_M}
    for pictures in groups:
        counts = {class_id: 0 for class_id in wanted}
        for picture in pictures:
            for box, class_id in zip(picture.boxes, picture.classes.tolist()):
                if class_id in wanted and counts[class_id] < MOST_CUT_OUTS:
                    one = cut_out(picture, box, class_id)
                    if one is not None:
                        counts[class_id] += 1
                        found.setdefault(class_id, []).append(one)
    return found


def put_objects(
    rng: np.random.Generator, image: np.ndarray, cut_outs: Dict[int, List[CutOut]], taken: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Up to MOST_OBJECTS objects onto the road of `image`, in place, where `taken` (N x 4) leaves room; boxes and classes of these."""
    height, width = image.shape[:2]
    ground = Ground(float(rng.uniform(*HORIZON)) * height, float(rng.uniform(*CAMERA_M)))
    classes_of = sorted(cut_outs)
    boxes, classes = np.zeros((0, 4), np.float32), []
    far_first = np.sort(ground.horizon_px + rng.uniform(0.06, 0.5, rng.integers(0, MOST_OBJECTS + 1)) * height)
    for row in far_first:
        class_id = classes_of[rng.integers(len(classes_of))]
        one = cut_outs[class_id][rng.integers(len(cut_outs[class_id]))]
        object_m = HEIGHTS_M[CLASSES[class_id]] * float(np.exp(rng.uniform(-0.4, 0.4)))
        tall = min(ground.height_px(object_m, row), MOST_ENLARGED * one.rgba.shape[0], 0.7 * height)
        wide = tall * one.rgba.shape[1] / one.rgba.shape[0]
        foot = (float(rng.uniform(0.1, 0.9)) * width, float(row))
        box = np.array([[foot[0] - wide / 2, foot[1] - tall, foot[0] + wide / 2, foot[1]]], np.float32)
        covered = np.minimum(taken[:, 2:], box[:, 2:]) - np.maximum(taken[:, :2], box[:, :2])
        if tall < LEAST_HEIGHT_PX or (covered.clip(min=0).prod(axis=1) > 0).any() or box[0, 0] < 0 or box[0, 2] > width or row > height:
            continue
        if rng.random() < 0.7:
            cast_contact_shadow(image, foot, wide, float(rng.uniform(0.1, 0.5)))
        paste(image, None, one, 0, foot, tall, float(rng.uniform(0.6, 1.3)), bool(rng.random() < 0.5))
        boxes, taken = np.vstack([boxes, box]), np.vstack([taken, box])
        classes.append(class_id)
    return boxes, np.array(classes, np.int64)
