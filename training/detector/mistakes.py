"""The worst mistakes of a detector on labelled pictures, drawn for a person who counts their causes."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Sequence

import cv2
import numpy as np

from .boxes import areas, pairwise_iou
from .data import DataError, Picture
from .metrics import ScoredFrame, find_false
from .validation import DetectorRunner, scored_frames

IOU = 0.5
COLUMNS, ROWS = 5, 4
TILE_PX, CAPTION_PX = 240, 18
CONTEXT = 3.0
"""Side of a tile, as a multiple of the box's longer one."""
LEAST_SIDE_PX = 72
LABEL_COLOUR, DETECTION_COLOUR = (0, 200, 0), (0, 0, 255)  # BGR
FAINT = 0.1
"""Detections below this are not drawn."""


@dataclass
class Mistake:
    """A label that was not found, or a detection where no label is."""

    class_name: str
    kind: str  # missed or false
    part: str  # the set
    picture: Picture
    frame: ScoredFrame
    box: np.ndarray  # corners in pixels
    score: float  # missed: of the best detection that overlaps it, 0 without one; false: its own


def mistakes_of(class_name: str, part: str, picture: Picture, frame: ScoredFrame, threshold: float) -> List[Mistake]:
    """All mistakes of one class in one picture at a threshold."""
    overlaps = pairwise_iou(frame.detections[:, :4], frame.labels) >= IOU
    found = []
    for number, label in enumerate(frame.labels):
        score = float(frame.detections[overlaps[:, number], 4].max(initial=0.0))
        if score < threshold:
            found.append(Mistake(class_name, "missed", part, picture, frame, label, score))
    for detection in frame.detections[find_false(frame, IOU)]:
        if detection[4] >= threshold:
            found.append(Mistake(class_name, "false", part, picture, frame, detection[:4], float(detection[4])))
    return found


def find_mistakes(
    runner: DetectorRunner, parts: Dict[str, List[Picture]], classes: Sequence[str], thresholds: Dict[str, float]
) -> List[Mistake]:
    """All mistakes at the manifest's thresholds, the worst of a class and kind first.

    The worst label missed is the one with the lowest score, the largest of equal ones; the worst false detection has
    the highest score.
    """
    found = [
        mistake
        for part, pictures in parts.items()
        for picture in pictures
        for name, frame in scored_frames(picture, runner.detect(picture.image), classes).items()
        for mistake in mistakes_of(name, part, picture, frame, thresholds[name])
    ]
    return sorted(found, key=lambda one: (
        one.class_name, one.kind, one.score if one.kind == "missed" else -one.score, -float(areas(one.box[None])[0])))


def draw(mistake: Mistake) -> np.ndarray:
    """A tile: the box in its surroundings, labels green, detections red, and what it is below."""
    left, top, right, bottom = mistake.box
    side = max(CONTEXT * max(right - left, bottom - top), LEAST_SIDE_PX)
    scale = TILE_PX / side
    corner = np.array([(left + right - side) / 2, (top + bottom - side) / 2])
    affine = np.array([[scale, 0, -scale * corner[0]], [0, scale, -scale * corner[1]]])
    bgr = cv2.cvtColor(mistake.picture.image, cv2.COLOR_RGB2BGR)
    tile = cv2.warpAffine(bgr, affine, (TILE_PX, TILE_PX), flags=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    seen = mistake.frame.detections[mistake.frame.detections[:, 4] >= FAINT, :4]
    for boxes, colour in ((mistake.frame.labels, LABEL_COLOUR), (seen, DETECTION_COLOUR)):
        for box in boxes:
            begin, end = (np.round((np.reshape(box, (2, 2)) - corner) * scale)).astype(int)
            cv2.rectangle(tile, tuple(map(int, begin)), tuple(map(int, end)), colour, 1)
    caption = np.full((CAPTION_PX, TILE_PX, 3), 255, np.uint8)
    text = f"{mistake.score:.2f} {mistake.part[:14]} {mistake.picture.name[:14]}"
    cv2.putText(caption, text, (2, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return np.vstack([tile, caption])


def write_mistakes(found: Sequence[Mistake], folder: Path) -> None:
    """A sheet CLASS-missed.jpg and CLASS-false.jpg of each class's worst, and mistakes.csv of all; `folder` must be new."""
    if folder.exists():
        raise DataError(f"--mistakes: '{folder}' is there already, accepted is a new folder.")
    folder.mkdir(parents=True)
    with open(folder / "mistakes.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["class", "kind", "set", "image", "score", "x_min", "y_min", "x_max", "y_max"])
        for one in found:
            table.writerow([one.class_name, one.kind, one.part, one.picture.name, f"{one.score:.3f}", *(f"{v:.1f}" for v in one.box)])
    for name, kind in sorted({(one.class_name, one.kind) for one in found}):
        worst = [one for one in found if (one.class_name, one.kind) == (name, kind)][: COLUMNS * ROWS]
        tiles = [draw(one) for one in worst]
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % COLUMNS)
        rows = [np.hstack(tiles[begin : begin + COLUMNS]) for begin in range(0, len(tiles), COLUMNS)]
        cv2.imwrite(str(folder / f"{name}-{kind}.jpg"), np.vstack(rows))
