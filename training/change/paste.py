"""Pairs from one photo: objects that stand in both pictures, in the first only, or in the second only."""

from typing import Dict, List, Tuple

import numpy as np

from common.pasting import CutOut, Ground, cast_contact_shadow, paste

from .classes import CLASSES, NO_CHANGE
from .objects import CLASS_SHARES, HEIGHTS_M, MOST_ENLARGED

MOST_OBJECTS = 6
FATES = ("stays", "appears", "vanishes", "replaced")
FATE_SHARES = (0.3, 0.3, 0.3, 0.1)


def draw_ground(rng: np.random.Generator, group: str, height: int) -> Ground:
    """Where the horizon of such a photo may be: a survey camera looks down, its horizon lies at the upper border."""
    if group == "survey":
        return Ground(float(rng.uniform(-0.15, 0.02)) * height, 2.3)
    return Ground(float(rng.uniform(0.35, 0.6)) * height, 1.5)


def draw_cut_out(rng: np.random.Generator, cut_outs: Dict[int, List[CutOut]]) -> CutOut:
    """An object, its class drawn by CLASS_SHARES."""
    present = [class_id for class_id in sorted(cut_outs) if cut_outs[class_id]]
    shares = np.array([CLASS_SHARES[CLASSES[class_id]] for class_id in present])
    chosen = cut_outs[present[rng.choice(len(present), p=shares / shares.sum())]]
    return chosen[rng.integers(len(chosen))]


def paste_pair(
    rng: np.random.Generator, photo: np.ndarray, group: str, cut_outs: Dict[int, List[CutOut]]
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First picture, second picture and mask (H x W uint8, as the simulator makes it).

    A pixel is changed where the two show different objects and one of these came or went; its class is that of
    the object that appeared, where that is in sight, else of the one that vanished.
    """
    height, width = photo.shape[:2]
    ground = draw_ground(rng, group, height)
    pictures = [photo.copy(), photo.copy()]
    shown = [np.zeros((height, width), np.int32) for _ in pictures]
    classes, changed = [NO_CHANGE], [False]
    least = max(ground.horizon_px + 0.12 * height, 0.15 * height)
    for row in sorted(rng.uniform(least, 1.04 * height, rng.integers(1, MOST_OBJECTS + 1))):
        fate = FATES[rng.choice(len(FATES), p=FATE_SHARES)]
        foot, darkness = (float(rng.uniform(0, width)), float(row)), float(rng.uniform(0, 0.5))
        for which in range(2):
            if (fate, which) in (("appears", 0), ("vanishes", 1)):
                continue
            if which == 0 or fate in ("appears", "replaced"):
                cut_out, gain, mirrored = draw_cut_out(rng, cut_outs), float(rng.uniform(0.6, 1.3)), bool(rng.random() < 0.5)
                object_m = HEIGHTS_M[CLASSES[cut_out.class_id]] * float(rng.uniform(0.8, 1.25))
                classes.append(cut_out.class_id)
                changed.append(fate != "stays")
            height_px = min(max(ground.height_px(object_m, row), 8.0), 0.9 * height, MOST_ENLARGED * cut_out.rgba.shape[0])
            width_px = height_px * cut_out.rgba.shape[1] / cut_out.rgba.shape[0]
            cast_contact_shadow(pictures[which], foot, width_px, darkness)
            paste(pictures[which], shown[which], cut_out, len(classes) - 1, foot, height_px, gain, mirrored)
    class_of, change_of = np.array(classes, np.uint8), np.array(changed)
    before, after = shown
    came, went = change_of[after], change_of[before]
    mask = np.where(came, class_of[after], np.where(went, class_of[before], NO_CHANGE))
    return pictures[0], pictures[1], mask.astype(np.uint8)
