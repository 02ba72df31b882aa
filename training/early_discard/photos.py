"""Photos of the sets (training/real_hazards.yaml) made ready for the classifier.

A set labels some classes only. A frame with a labelled hazard is worth sending, whatever else it shows. Its other places,
and frames without a label, teach that there is nothing only where somebody looked: all classes are labelled or said to be
absent, or the zone's detector looked for those that are not (a judge). What the judge finds of them, however unsure, makes
its place unknown.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Callable, Dict, List, Optional, Tuple

import cv2
import numpy as np

from detector import CLASSES, sets
from detector.data import Picture

from .labels import Background, is_reportable, prepared

CALIBRATION_SETS = ("pothole_dash_turkey", "road_obstacle21", "accident_cctv")
"""Sources that the classifier never learns from: its threshold is chosen on their training parts."""

DOUBTFUL = 0.1
"""Score from which on the judge's find makes a place unknown."""

ZOOMS = (0.0, 1.0, 1.8)
"""Views of a photo: within the input, filling it, and from nearer."""

SCENES = 480
"""Streets with hazards put into them."""

SCENES_WEIGHT, PAINTED_OUT_WEIGHT = 0.25, 1.5
"""How often scenes, and streets whose hazards are painted out, are drawn beside the photos of the sets, which count 1."""

MOST_PAINTED = 0.12
"""Of a picture, up to which its hazards are painted out."""

Judge = Callable[[np.ndarray], List[np.ndarray]]
"""Detections (M x 5) per class of an H x W x 3 picture."""


@dataclass
class LabelledPhoto:
    """A photo to measure on, prepared."""

    picture: Picture
    classes: List[str]  # of its reportable boxes


def judged(picture: Picture, judge: Optional[Judge]) -> Tuple[Picture, Background]:
    """A set's picture with its unknown places, and what its background says."""
    unlabelled = sorted(set(range(len(CLASSES))) - set(picture.labelled_classes))
    if not unlabelled:
        return picture, Background.KNOWN
    if judge is None:
        return picture, Background.LIKELY if set(unlabelled) <= set(picture.absent_classes) else Background.UNKNOWN
    found = judge(picture.image)
    doubtful = np.vstack([picture.difficult, *(found[class_id][found[class_id][:, 4] >= DOUBTFUL, :4] for class_id in unlabelled)])
    return replace(picture, difficult=doubtful.astype(np.float32)), Background.KNOWN


def views_of(picture: Picture, background: Background) -> List[Picture]:
    """A photo as the vehicle's program would show it, filling the input, and from nearer: parts of it, many without a hazard."""
    return [replace(prepared(picture, None, background, zoom), weight=picture.weight / len(ZOOMS)) for zoom in ZOOMS]


def painted_out(picture: Picture) -> Optional[Picture]:
    """The street without its hazards, their places filled from around them (Telea 2004); None where they are too large."""
    height, width = picture.image.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    for left, top, right, bottom in picture.boxes:
        margin_x, margin_y = max(0.15 * (right - left), 2), max(0.15 * (bottom - top), 2)
        corners = np.clip([left - margin_x, top - margin_y, right + margin_x, bottom + margin_y], 0, [width, height] * 2).astype(int)
        mask[corners[1] : corners[3], corners[0] : corners[2]] = 255
    if mask.mean() > MOST_PAINTED * 255:
        return None
    image = cv2.inpaint(picture.image, mask, 4, cv2.INPAINT_TELEA)
    return replace(picture, image=image, boxes=picture.boxes[:0], classes=picture.classes[:0])


def weighted(group: List[Picture], weight: float) -> List[Picture]:
    """Pictures that all weigh the same, together `weight`."""
    return [replace(picture, weight=weight / len(group)) for picture in group]


def compose_scenes(pasted: sets.Pasted, streets: List[Tuple[Picture, Background]], seed: int) -> List[Picture]:
    """Streets with signs and hazards of other photos put into them, prepared."""
    scenes = []
    for index in range(SCENES):
        rng = np.random.default_rng([seed, 9, index])
        street, background = streets[rng.integers(len(streets))]
        scenes.append(prepared(pasted.into(rng, street), None, background))
    return scenes


def read_groups(
    catalogue: sets.Catalogue, data: Path, judge: Optional[Judge], calm: List[Picture], seed: int
) -> Dict[str, List[Picture]]:
    """The photos to learn from, a group for each set, and scenes: `calm` are roads without a hazard, into which hazards are put as well."""
    splits = sets.read_splits(catalogue, data)
    learnt = {name: [judged(one, judge) for one in split.training] for name, split in splits.items() if name not in CALIBRATION_SETS}
    groups = {
        f"set:{name}": [view for picture, background in pictures for view in views_of(picture, background)]
        for name, pictures in learnt.items()
    }
    total = sum(picture.weight for group in groups.values() for picture in group)
    streets = [one for entry in catalogue.sets if entry.background for one in learnt.get(entry.name, [])]
    painted = [(painted_out(picture), background) for picture, background in streets]
    emptied = [view for picture, background in painted if picture for view in views_of(picture, background)]
    groups["set:painted_out"] = weighted(emptied, PAINTED_OUT_WEIGHT * total)
    if catalogue.signs:
        faces = sets.signs.read_faces(data / catalogue.signs["folder"], catalogue.signs["kind"], held_out=False)
        cut_outs = sets.read_cut_outs([[picture for picture, _ in pictures] for pictures in learnt.values()])
        pasted = sets.Pasted(faces, catalogue.signs["class"], cut_outs)
        scenes = compose_scenes(pasted, streets + [(picture, Background.KNOWN) for picture in calm], seed)
        groups["set:composed"] = weighted(scenes, SCENES_WEIGHT * total)
    return groups


def labelled_photo(picture: Picture) -> LabelledPhoto:
    """A set's picture to measure on."""
    classes = sorted({CLASSES[class_id] for class_id in picture.classes[is_reportable(picture, None)].tolist()})
    return LabelledPhoto(prepared(picture, None, Background.UNKNOWN), classes)


def read_calibration(catalogue: sets.Catalogue, data: Path) -> Dict[str, List[LabelledPhoto]]:
    """By set, the photos that the threshold is chosen on."""
    chosen = [one for one in catalogue.sets if one.name in CALIBRATION_SETS]
    return {one.name: [labelled_photo(picture) for picture in sets.read_split(one, data, catalogue.rename).training] for one in chosen}


def read_held_out(catalogue: sets.Catalogue, data: Path) -> Dict[str, List[LabelledPhoto]]:
    """By set, and for the composed scenes, the photos that nothing was trained or chosen on."""
    held_out = sets.read_pictures(catalogue, data).held_out
    return {name: [labelled_photo(picture) for picture in pictures] for name, pictures in held_out.items()}
