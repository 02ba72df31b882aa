"""Tiny streets in the layout of `livemap simulate --change`, generated: textured ground, boxes that come and go."""

from pathlib import Path
from typing import Tuple

import cv2
import numpy as np

from change.classes import CLASSES, COLOURS

from .synthetic import write_data

SIGN, VEHICLE = CLASSES.index("sign"), CLASSES.index("vehicle")
OBJECTS = ((VEHICLE, (90, 120, 60, 40), (30, 60, 190)), (SIGN, (210, 60, 24, 60), (200, 30, 30)))
"""Class, box (left, top, width, height) and colour of what may stand in a street."""


def ground(seed: int, size: Tuple[int, int] = (320, 256)) -> np.ndarray:
    """A picture with enough corners to be registered."""
    rng = np.random.default_rng(seed)
    image = np.full((size[1], size[0], 3), 120, np.uint8)
    for _ in range(160):
        left, top = int(rng.integers(0, size[0])), int(rng.integers(0, size[1]))
        colour = tuple(int(value) for value in rng.integers(60, 200, 3))
        cv2.rectangle(image, (left, top), (left + int(rng.integers(4, 20)), top + int(rng.integers(4, 20))), colour, -1)
    return image


def street(seed: int, first: bool, second: bool) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both passes' pictures, with objects in the passes that are named, and the mask."""
    pictures, mask = [ground(seed), ground(seed)], np.zeros((256, 320), np.uint8)
    for class_id, (left, top, width, height), colour in OBJECTS:
        box = (slice(top, top + height), slice(left, left + width))
        for picture, shown in zip(pictures, (first, second)):
            if shown:
                picture[box] = colour
        if first != second:
            mask[box] = class_id
    return pictures[0], pictures[1], mask


def write_pair(data_set: Path, number: int, first: np.ndarray, second: np.ndarray, mask: np.ndarray, coloured: bool = False) -> None:
    """One pair as raw/000/RGB/1_II.png, 2_II.png and GT/gtII.png."""
    folder = data_set / "raw" / "000"
    if coloured:
        table = np.zeros((256, 3), np.uint8)
        table[: len(COLOURS)] = COLOURS
        mask = table[mask][..., ::-1]
    for path, image in (
        (folder / "RGB" / f"1_{number:02d}.png", first[..., ::-1]), (folder / "RGB" / f"2_{number:02d}.png", second[..., ::-1]),
        (folder / "GT" / f"gt{number:02d}.png", mask),
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), image)


def write_streets(root: Path, seeds: Tuple[int, ...] = (1, 2)) -> Path:
    """Streets as training/simulate_change.py leaves them; returns the folder."""
    for seed in seeds:
        for name, first, second in (("some", False, True), ("none", True, True), ("all", True, False)):
            write_pair(root / f"{seed:06d}" / name, 0, *street(seed, first, second))
    return root


def write_photos(root: Path) -> Path:
    """A data folder with photos and signs to paste; returns it."""
    write_data(root)
    for number in range(6):
        path = root / "sign_crops" / "stop" / f"{number:05d}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), np.full((40, 40, 3), (30, 30, 200), np.uint8))
    return root
