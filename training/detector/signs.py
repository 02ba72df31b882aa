"""Traffic signs put into photos: crops cut along their outline, on a post beside the road.

Crops of road-work signs are the class; those of other signs are there to be told apart from it. Diamonds as they
stand in the Americas are drawn: orange ones mean road works, yellow ones something else.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import List, Sequence

import cv2
import numpy as np

from common.files import list_pictures

from . import CLASSES, inference
from .boxes import pairwise_iou
from .data import DataError, Picture

HELD_OUT_SIGNS = 5
"""One crop in so many of a kind is held out."""

OUTLINES = {"general_caution": "up", "road_work": "up", "wild_animals": "up", "yield": "down"}
"""Triangles, by the corner that stands alone; the other kinds are round, or nearly."""

FACE_PX = (9.0, 80.0)
"""Height of a sign's face in the network's input, smallest and largest."""

DRAWN_SHARE, YELLOW_SHARE = 0.25, 0.12
"""How often a sign is a drawn diamond, and how often a triangle's white is yellow, as in the north of Europe."""

POSITIVE_SHARE = 0.6
"""How often a sign is one of road works."""

ORANGE, YELLOW = (245, 120, 20), (250, 205, 30)
TEXTS = ("ROAD WORK", "WORK AHEAD", "DETOUR", "LANE CLOSED", "OBRAS", "MEN WORKING", "FLAGGER")


@dataclass
class Face:
    """A sign without what was around it."""

    rgba: np.ndarray  # H x W x 4 uint8
    is_road_work: bool


@dataclass
class Faces:
    """All faces to put into pictures."""

    road_work: List[Face]
    other: List[Face]
    drawn: bool  # diamonds too

    def draw(self, rng: np.random.Generator, is_road_work: bool) -> Face:
        """One of a kind."""
        if self.drawn and rng.random() < DRAWN_SHARE:
            return draw_diamond(rng, is_road_work)
        faces = self.road_work if is_road_work else self.other
        face = faces[rng.integers(len(faces))]
        if self.drawn and rng.random() < YELLOW_SHARE:
            rgba = face.rgba.copy()
            rgba[..., 2] = rgba[..., 2] * 0.3
            return Face(rgba, face.is_road_work)
        return face


def cut_face(crop: np.ndarray, outline: str) -> np.ndarray:
    """An RGB crop of a sign as RGBA, cut along its outline and to its extent."""
    height, width = crop.shape[:2]
    shape = np.zeros((256, 256), np.uint8)
    if outline == "round":
        cv2.circle(shape, (128, 128), 112, 255, -1)
    else:
        corners = np.array([[128, 14], [14, 236], [242, 236]])
        cv2.fillPoly(shape, [corners if outline == "up" else [0, 256] + [1, -1] * corners], 255)
    alpha = cv2.resize(shape, (width, height), interpolation=cv2.INTER_AREA)
    rows, columns = np.where((alpha > 127).any(axis=1))[0], np.where((alpha > 127).any(axis=0))[0]
    return np.dstack([crop, alpha])[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def draw_diamond(rng: np.random.Generator, is_road_work: bool) -> Face:
    """A diamond with a black rim and a text or a figure, orange or yellow."""
    colour = np.array(ORANGE if is_road_work else YELLOW) * rng.uniform(0.8, 1.0) + rng.normal(0, 8, 3)
    rgba = np.zeros((128, 128, 4), np.uint8)
    diamond = lambda reach: np.array([[64, 64 - reach], [64 + reach, 64], [64, 64 + reach], [64 - reach, 64]])
    cv2.fillPoly(rgba, [diamond(63)], (*colour.clip(0, 255).tolist(), 255), cv2.LINE_AA)
    cv2.polylines(rgba, [diamond(57)], True, (20, 20, 20, 255), 3, cv2.LINE_AA)
    if rng.random() < 0.5:
        words = TEXTS[rng.integers(len(TEXTS))].split() if is_road_work else ("SLOW",)
        for row, word in enumerate(words):
            scale = min(0.9, 5.5 / len(word))
            size = cv2.getTextSize(word, cv2.FONT_HERSHEY_SIMPLEX, scale, 2)[0]
            place = (64 - size[0] // 2, 70 + 26 * row - 13 * (len(words) - 1))
            cv2.putText(rgba, word, place, cv2.FONT_HERSHEY_SIMPLEX, scale, (15, 15, 15, 255), 2, cv2.LINE_AA)
    elif is_road_work:  # a figure with a shovel and a heap
        x, y = 52 + int(rng.integers(-4, 5)), 36 + int(rng.integers(-3, 4))
        cv2.circle(rgba, (x, y), 6, (15, 15, 15, 255), -1)
        for begin, end in (((x, y + 6), (x - 6, y + 32)), ((x - 6, y + 32), (x - 14, y + 54)), ((x - 6, y + 32), (x + 6, y + 54)),
                           ((x, y + 12), (x + 20, y + 26)), ((x - 4, y + 16), (x + 34, y + 48))):
            cv2.line(rgba, begin, end, (15, 15, 15, 255), 5, cv2.LINE_AA)
        cv2.ellipse(rgba, (x + 34, y + 56), (12, 9), 0, 180, 360, (15, 15, 15, 255), -1)
    else:  # a bent arrow
        bend = int(rng.integers(-20, 21))
        cv2.polylines(rgba, [np.array([[64, 100], [64, 66], [64 + bend, 34]])], False, (15, 15, 15, 255), 8, cv2.LINE_AA)
    return Face(rgba, is_road_work)


def read_faces(folder: Path, kind: str, held_out: bool) -> Faces:
    """The faces of one part; held-out ones are crops alone."""
    faces = Faces([], [], not held_out)
    for kind_folder in sorted(path for path in folder.glob("*") if path.is_dir()):
        for number, path in enumerate(list_pictures(kind_folder)):
            if (number % HELD_OUT_SIGNS == 0) != held_out:
                continue
            crop = cv2.imread(str(path), cv2.IMREAD_COLOR)
            if crop is None:
                raise DataError(f"Cannot read the image {path}.")
            rgba = cut_face(cv2.cvtColor(crop, cv2.COLOR_BGR2RGB), OUTLINES.get(kind_folder.name, "round"))
            (faces.road_work if kind_folder.name == kind else faces.other).append(Face(rgba, kind_folder.name == kind))
    if not faces.road_work or not faces.other:
        raise DataError(f"The folder {folder} needs crops (PNG or JPEG) of {kind} and of another kind of sign.")
    return faces


def put_sign(rng: np.random.Generator, image: np.ndarray, face: Face, scale: float, taken: np.ndarray) -> np.ndarray:
    """Put a sign on its post into `image` (changed in place), whose letterbox has that scale.

    Returns its box (1 x 4), or None where it would cover one of `taken` (N x 4).
    """
    height, width = image.shape[:2]
    tall = float(np.exp(rng.uniform(*np.log(FACE_PX)))) / scale
    tall = min(tall, 0.3 * height)
    source = face.rgba
    size = max(int(tall * source.shape[1] / source.shape[0] * rng.uniform(0.75, 1.03)), 4), max(int(tall), 4)
    shrink = size[1] < source.shape[0]
    patch = cv2.resize(source, size, interpolation=cv2.INTER_AREA if shrink else cv2.INTER_LINEAR).astype(np.float32)
    lean = cv2.getRotationMatrix2D((size[0] / 2, size[1] / 2), rng.uniform(-4, 4), 1.0)
    patch = cv2.warpAffine(patch, lean, size, borderMode=cv2.BORDER_CONSTANT, borderValue=(0, 0, 0, 0))
    aside = rng.uniform(0.02, 0.36) if rng.random() < 0.75 else rng.uniform(0.3, 0.5)
    centre = aside if rng.random() < 0.5 else 1 - aside
    left = int(np.clip(centre * width - size[0] / 2, 0, width - size[0]))
    top = int(np.clip(rng.normal(0.33, 0.12) * height, 0, height - size[1]))
    box = np.array([[left, top, left + size[0], top + size[1]]], np.float32)
    if len(taken) and pairwise_iou(box, taken).max() > 0:
        return None
    alpha = patch[..., 3:] / 255
    lightness = float((patch[..., :3] * alpha).sum() / max(3 * alpha.sum(), 1e-6))
    colour = patch[..., :3] * np.clip(rng.uniform(70, 190) / max(lightness, 1.0), 0.5, 2.5)
    post = max(int(0.06 * size[1]), 1)
    middle, foot = left + size[0] // 2, min(int(top + size[1] * rng.uniform(2.5, 3.5)), height)
    grey = rng.uniform(60, 160)
    image[top + size[1] // 2 : foot, middle : middle + post] = grey
    place = image[top : top + size[1], left : left + size[0]]
    blurred = cv2.GaussianBlur(np.dstack([colour, 255 * alpha]), (0, 0), rng.uniform(0.3, 0.8))
    alpha = blurred[..., 3:] / 255
    place[:] = (place * (1 - alpha) + blurred[..., :3].clip(0, 255) * alpha).astype(np.uint8)
    return box


def compose(rng: np.random.Generator, picture: Picture, faces: Faces, class_name: str) -> Picture:
    """A picture with one to three signs, of which those of road works are labelled."""
    class_id = CLASSES.index(class_name)
    image, boxes, classes = picture.image.copy(), picture.boxes, picture.classes
    scale = inference.letterbox_scale(*image.shape[1::-1], inference.INPUT_WIDTH, inference.INPUT_HEIGHT)
    taken = picture.boxes
    for index in range(rng.integers(1, 4)):
        face = faces.draw(rng, bool(rng.random() < POSITIVE_SHARE))
        box = put_sign(rng, image, face, scale, taken)
        if box is None:
            continue
        taken = np.vstack([taken, box])
        if face.is_road_work:
            boxes, classes = np.vstack([boxes, box]).astype(np.float32), np.append(classes, class_id)
    labelled = sorted({*picture.labelled_classes, class_id})
    return replace(picture, image=image, boxes=boxes, classes=classes, labelled_classes=labelled)


def compose_held_out(pictures: Sequence[Picture], faces: Faces, class_name: str) -> List[Picture]:
    """Each picture once with held-out signs, the same at every call; only the signs count as labelled there."""
    class_id = CLASSES.index(class_name)
    scenes = []
    for index, picture in enumerate(pictures):
        empty = replace(picture, boxes=picture.boxes[:0], classes=picture.classes[:0])
        scene = compose(np.random.default_rng([7, index]), empty, faces, class_name)
        scenes.append(replace(scene, labelled_classes=[class_id], name="composed_" + picture.name))
    return scenes
