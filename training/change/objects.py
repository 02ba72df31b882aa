"""Objects cut out of simulated pictures, photos and crops of signs (common/pasting.py puts them into photos)."""

from pathlib import Path
from typing import Dict, List, Sequence

import cv2
import numpy as np

from common.files import PictureFolder, list_pictures, read_text
from common.pasting import CONE, CutOut, cut_box
from detector.data import DataError

from .classes import CLASSES, NO_CHANGE
from .data import IGNORED, VALIDATION_SIGNS, Scene, read_image

HEIGHTS_M = {
    "barrier": 1.0, "bin": 1.1, "construction": 2.4, "other_objects": 1.0, "person_cycle": 1.6, "rubbish": 0.5, "sign": 2.3,
    "traffic_cone": 0.7, "vehicle": 1.5,
}
"""Typical height by class."""

CLASS_SHARES = {
    "barrier": 0.08, "bin": 0.08, "construction": 0.05, "other_objects": 0.08, "person_cycle": 0.10, "rubbish": 0.06,
    "sign": 0.18, "traffic_cone": 0.2, "vehicle": 0.17,
}
"""How often each class is pasted, where there are objects of it."""

LEAST_HEIGHT_PX = 18
MOST_ENLARGED = 2.0
"""Smaller cut-outs, and larger pastes of them, show blots rather than objects."""

CONE_HEIGHT_PX = 96
"""Cones are shrunk to this before they are cut out, which takes long at full size."""

SIGN_OUTLINES = {"general_caution": "up", "road_work": "up", "wild_animals": "up", "yield": "down"}
"""Triangles, by the corner that stands alone; the other kinds are round, or nearly."""


def cut_scene(scene: Scene) -> List[CutOut]:
    """The connected objects of a simulated picture that the border does not cut."""
    found = []
    height, width = scene.classes.shape
    known = np.where(scene.classes == IGNORED, NO_CHANGE, scene.classes)
    for class_id in np.unique(known[known != NO_CHANGE]):
        _, labels, stats, _ = cv2.connectedComponentsWithStats((known == class_id).astype(np.uint8))
        for label, (left, top, wide, high, area) in enumerate(stats):
            inside = left > 1 and top > 1 and left + wide < width - 1 and top + high < height - 20
            if label == 0 or not inside or high < LEAST_HEIGHT_PX or area < 0.2 * wide * high:
                continue
            part = (slice(top, top + high), slice(left, left + wide))
            alpha = (labels[part] == label).astype(np.uint8) * 255
            found.append(CutOut(np.dstack([scene.image[part], alpha]), int(class_id)))
    return found


def read_cones(data: Path, validation: bool) -> List[CutOut]:
    """Cones of the street photos that are large enough."""
    split, found = "val" if validation else "train", []
    folder = data / "traffic_cones"
    pictures = PictureFolder(folder / "images" / split)
    for label_path in sorted((folder / "labels" / split).glob("*.txt")):
        rows = [[float(value) for value in line.split()] for line in read_text(label_path).splitlines() if line.strip()]
        if not rows:
            continue
        image = read_image(pictures.find(label_path.stem) or folder / "images" / split / f"{label_path.stem}.jpg")
        for _, x, y, wide, high in rows:
            if high * image.shape[0] < 40 or wide * image.shape[1] < 16 or high > 0.7:
                continue
            scale = min(CONE_HEIGHT_PX / (high * image.shape[0]), 1.0)
            small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            centre, size = (np.array(part) * small.shape[1::-1] for part in ((x, y), (wide, high)))
            rgba = cut_box(small, np.concatenate([centre - size / 2, centre + size / 2]), CONE)
            if rgba.size:
                found.append(CutOut(rgba, CLASSES.index("traffic_cone")))
    return found


def read_signs(data: Path, validation: bool) -> List[CutOut]:
    """Signs from their crops, each on a grey post: one in five of a kind is kept for validation."""
    found = []
    for kind in sorted(path for path in (data / "sign_crops").glob("*") if path.is_dir()):
        for number, path in enumerate(list_pictures(kind)):
            if (number % VALIDATION_SIGNS == 0) == validation:
                crop = cv2.resize(read_image(path), (64, 64), interpolation=cv2.INTER_LINEAR)
                found.append(CutOut(on_post(crop, SIGN_OUTLINES.get(kind.name, "round")), CLASSES.index("sign")))
    if not found:
        raise DataError(f"The folder {data} holds no sign (sign_crops/*/*.png).")
    return found


def on_post(crop: np.ndarray, outline: str) -> np.ndarray:
    """A 64 x 64 crop of a sign, cut along its outline, atop a post: 64 x 208 RGBA (a face of 0.7 m at 2.3 m)."""
    rgba = np.zeros((208, 64, 4), np.uint8)
    rgba[40:, 30:34] = (118, 120, 122, 255)
    face = np.zeros((64, 64), np.uint8)
    if outline == "round":
        cv2.circle(face, (32, 32), 27, 255, -1)
    else:
        corners = np.array([[32, 6], [5, 56], [59, 56]])
        cv2.fillPoly(face, [corners if outline == "up" else [0, 64] + [1, -1] * corners], 255)
    rgba[:64][face > 0] = np.dstack([crop, face])[face > 0]
    return rgba


def read_cut_outs(data: Path, scenes: Sequence[Scene], validation: bool) -> Dict[int, List[CutOut]]:
    """All objects to paste, by class."""
    cut_outs = read_cones(data, validation) + read_signs(data, validation)
    cut_outs += [cut_out for scene in scenes for cut_out in cut_scene(scene)]
    by_class: Dict[int, List[CutOut]] = {}
    for cut_out in cut_outs:
        by_class.setdefault(cut_out.class_id, []).append(cut_out)
    return by_class
