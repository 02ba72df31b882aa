"""Sets of labelled photos, each with its own classes and a part that is held out, as a YAML file lists them.

training/real_hazards.yaml is such a file, and explains the entries.
"""

import fnmatch
import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np
import yaml

from common.files import list_pictures, read_text
from common.pasting import CutOut

from . import CLASSES, signs
from .cutouts import put_objects, read_cut_outs
from .data import DataError, Picture, read_class_names, read_picture, weigh_by_rarest_class

EVERY_BLOCK, FIRST_BLOCK = 5, 1
"""Where blocks are held out: every fifth, from the second on."""


@dataclass(frozen=True)
class LabelledSet:
    """One folder of photos and what its labels mean."""

    name: str
    folder: Path
    labelled: Tuple[str, ...]
    absent: Tuple[str, ...] = ()
    classes: Tuple[str, ...] = ()  # of the label files; none: the folder's classes.txt
    patterns: Tuple[str, ...] = ()  # file names that are held out
    block: int = 0  # pictures in a row, where patterns do not say what is held out
    skip: Tuple[str, ...] = ()
    background: bool = False
    weight: float = 1.0

    def is_held_out(self, names: Sequence[str]) -> List[bool]:
        """Which of the pictures, in natural order, are never trained on."""
        if self.block:
            return [index // self.block % EVERY_BLOCK == FIRST_BLOCK for index in range(len(names))]
        return [matches(name, self.patterns) for name in names]


@dataclass(frozen=True)
class Catalogue:
    """All sets of a file."""

    sets: Tuple[LabelledSet, ...]
    rename: Dict[str, str]
    signs: Dict[str, str] = field(default_factory=dict)  # folder, kind and class; empty: none
    digest: str = ""  # of the file's content


@dataclass
class Split:
    """A set's pictures in its two parts."""

    training: List[Picture]
    held_out: List[Picture]


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Whether a file name without its ending fits one of the patterns, letter by letter."""
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def read_set(name: str, entry: dict) -> LabelledSet:
    """One entry of the file, checked."""
    known = {"folder", "classes", "labelled", "absent", "held_out", "skip", "background", "weight"}
    unknown = set(entry) - known
    if unknown:
        raise DataError(f"The set {name} has the unknown entry '{sorted(unknown)[0]}', accepted are {', '.join(sorted(known))}.")
    held_out = entry["held_out"]
    block = int(held_out["blocks"]) if isinstance(held_out, dict) else 0
    labelled, absent = tuple(entry["labelled"]), tuple(entry.get("absent", ()))
    for class_name in labelled + absent:
        if class_name not in CLASSES:
            raise DataError(f"The set {name} names the class '{class_name}', which the detector does not have.")
    if not labelled or set(labelled) & set(absent) or block < 0:
        raise DataError(f"The set {name} must label a class, and none of these may be absent; blocks must be positive.")
    return LabelledSet(
        name, Path(entry["folder"]), labelled, absent, tuple(entry.get("classes", ())), () if block else tuple(held_out), block,
        tuple(entry.get("skip", ())), bool(entry.get("background", False)), float(entry.get("weight", 1.0)),
    )


def read_catalogue(path: Path) -> Catalogue:
    """Read a file of sets."""
    try:
        text = read_text(path)
        content = yaml.safe_load(text)
        sets = tuple(read_set(name, entry) for name, entry in content["sets"].items())
        rename = {str(theirs): str(ours) for theirs, ours in content.get("rename", {}).items()}
        signs = {key: str(content["signs"][key]) for key in ("folder", "kind", "class")} if content.get("signs") else {}
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"Cannot read the sets {path}: {error!r}.") from error
    return Catalogue(sets, rename, signs, hashlib.sha256(text.encode()).hexdigest()[:12])


def class_ids_of(one: LabelledSet, folder: Path, rename: Dict[str, str]) -> List[int]:
    """Our classes in the order of the label files'; -1: not one of ours."""
    names = [rename.get(name, name) for name in one.classes or read_class_names(folder)]
    return [CLASSES.index(name) if name in CLASSES else -1 for name in names]


def set_paths(one: LabelledSet, data: Path) -> List[Path]:
    """The picture files of a set."""
    paths = [path for path in list_pictures(data / one.folder / "images") if not matches(path.stem, one.skip)]
    if not paths:
        raise DataError(f"The folder {data / one.folder / 'images'} holds no .jpg, .jpeg or .png image.")
    return paths


def training_paths(one: LabelledSet, data: Path) -> List[Path]:
    """Those of its training part."""
    paths = set_paths(one, data)
    return [path for path, held_out in zip(paths, one.is_held_out([path.stem for path in paths])) if not held_out]


def read_split(one: LabelledSet, data: Path, rename: Dict[str, str]) -> Split:
    """The pictures of a set."""
    folder = data / one.folder
    paths = set_paths(one, data)
    class_ids = class_ids_of(one, folder, rename)
    labelled, absent = ([CLASSES.index(name) for name in names] for names in (one.labelled, one.absent))
    split = Split([], [])
    for path, held_out in zip(paths, one.is_held_out([path.stem for path in paths])):
        picture = read_picture(path, folder / "labels" / (path.stem + ".txt"), class_ids)
        for class_id in np.unique(picture.classes):
            if class_id not in labelled:
                raise DataError(f"The set {one.name} does not say that {CLASSES[class_id]} is labelled, but {path.stem}.txt has one.")
        picture.labelled_classes, picture.absent_classes = labelled, absent
        (split.held_out if held_out else split.training).append(picture)
    return split


def read_splits(catalogue: Catalogue, data: Path, left_out: Sequence[str] = ()) -> Dict[str, Split]:
    """All sets by name. Those of `left_out` are held out as a whole: a source that the training has never seen."""
    names = [one.name for one in catalogue.sets]
    for name in left_out:
        if name not in names:
            raise DataError(f"There is no set {name} to leave out, there are {', '.join(names)}.")
    splits = {one.name: read_split(one, data, catalogue.rename) for one in catalogue.sets}
    for name in left_out:
        splits[name] = Split([], splits[name].training + splits[name].held_out)
    weigh_by_rarest_class([picture for split in splits.values() for picture in split.training])
    for one in catalogue.sets:
        for picture in splits[one.name].training:
            picture.weight *= one.weight
    return splits


def backgrounds(catalogue: Catalogue, splits: Dict[str, Split]) -> Split:
    """Pictures that signs may be put into."""
    chosen = [splits[one.name] for one in catalogue.sets if one.background]
    return Split([p for split in chosen for p in split.training], [p for split in chosen for p in split.held_out])


@dataclass
class Pasted:
    """What is put into street photos to train on: signs, and hazards cut out of other photos."""

    faces: signs.Faces
    sign_class: str
    cut_outs: Dict[int, List[CutOut]] = field(default_factory=dict)

    def into(self, rng: np.random.Generator, picture: Picture) -> Picture:
        """A picture with one to three signs and, where there are cut-outs, some of these. Their classes are labelled."""
        composed = signs.compose(rng, picture, self.faces, self.sign_class)
        if not self.cut_outs:
            return composed
        boxes, classes = put_objects(rng, composed.image, self.cut_outs, composed.boxes)
        return replace(
            composed, boxes=np.vstack([composed.boxes, boxes]).astype(np.float32), classes=np.concatenate([composed.classes, classes])
        )


@dataclass
class SetPictures:
    """What the sets bring: groups to train on, parts to measure on, and what is put into pictures."""

    groups: Dict[str, List[Picture]]
    held_out: Dict[str, List[Picture]]
    pasted: Optional[Pasted] = None


def read_pictures(catalogue: Catalogue, data: Path, left_out: Sequence[str] = (), cut: bool = False) -> SetPictures:
    """The pictures of all sets; signs make a group and a held-out part of their own, "composed".

    `cut`: hazards of the training parts are cut out, to be put into pictures to train on too.
    """
    splits = read_splits(catalogue, data, left_out)
    result = SetPictures({f"set:{name}": split.training for name, split in splits.items() if split.training}, {})
    result.held_out = {name: split.held_out for name, split in splits.items() if split.held_out}
    if catalogue.signs:
        folder, streets = data / catalogue.signs["folder"], backgrounds(catalogue, splits)
        faces, held_out_faces = (signs.read_faces(folder, catalogue.signs["kind"], held_out) for held_out in (False, True))
        result.pasted = Pasted(faces, catalogue.signs["class"])
        if cut:
            result.pasted.cut_outs = read_cut_outs([split.training for split in splits.values()])
        result.groups["composed"] = streets.training
        result.held_out["composed"] = signs.compose_held_out(streets.held_out, held_out_faces, catalogue.signs["class"])
    return result
