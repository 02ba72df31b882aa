"""Readers of the data sets: survey drives, close-ups of potholes, street photos with cones, simulated drives, a user's own.

Images are kept decoded in memory (about 1.2 GB in all): decoding anew for every draw would cost
more than the network on a CPU.
"""

import csv
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Sequence, Tuple

import cv2
import numpy as np

from common.files import DataError, PictureFolder, list_pictures, read_text

from . import CLASSES

VALIDATION_SECTIONS = ("386RS169832", "251BDF0530", "080BDF0070", "290RS070691")
"""Drives that are never trained on; the split is fixed by the data's README."""

LABELLED_CLASSES = "labelled_classes.txt"
"""Beside classes.txt: the classes of which a folder labels every object."""

CLASS_NAME = "[a-z][a-z0-9_]{0,63}"
"""What a class may be called; a report's class has 64 bytes."""

POTHOLE, TRAFFIC_CONE = CLASSES.index("pothole"), CLASSES.index("traffic_cone")


@dataclass
class Picture:
    """One labelled image. Only the absence of `labelled_classes` means anything here."""

    image: np.ndarray  # H x W x 3 uint8, RGB
    boxes: np.ndarray  # N x 4 float32 corners in pixels
    classes: np.ndarray  # N int64, into CLASSES or, with classes of the user's own, with_own_classes()
    labelled_classes: Sequence[int]
    name: str = ""
    weight: float = 1.0  # how often to draw it, relative to others of its group
    difficult: np.ndarray = field(default_factory=lambda: np.zeros((0, 4), np.float32))  # K x 4 corners: nobody could name these
    difficult_classes: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    absent_classes: Sequence[int] = ()  # not labelled, but hardly ever in such pictures


@dataclass
class DriveFrame:
    """A picture at its place along the road."""

    picture: Picture
    chainage_m: float


def read_yolo_labels(path: Path, width: int, height: int, class_ids: Sequence[int]) -> Tuple[np.ndarray, np.ndarray]:
    """A label file (class cx cy w h per line, fractions of the image) to N x 4 corners in pixels and N classes.

    `class_ids` are ours in the order of the file's; -1: not one of ours, left out.
    """
    try:
        rows = [[float(value) for value in line.split()] for line in read_text(path).splitlines() if line.strip()]
    except ValueError as error:
        raise DataError(f"Cannot read the labels {path}: {error}.") from error
    if any(len(row) != 5 for row in rows):
        raise DataError(f"The label file {path} has a line without exactly 5 numbers (class cx cy w h).")
    if any(row[0] not in range(len(class_ids)) for row in rows):
        raise DataError(f"The label file {path} has a class that is not from 0 to {len(class_ids) - 1}.")
    table = np.array(rows).reshape(-1, 5)
    classes = np.array(class_ids)[table[:, 0].astype(int)].astype(np.int64)
    table, classes = table[classes >= 0, 1:] * [width, height, width, height], classes[classes >= 0]
    centres, half_sizes = table[:, :2], table[:, 2:] / 2
    return np.hstack([centres - half_sizes, centres + half_sizes]).astype(np.float32), classes


def read_picture(image_path: Path, label_path: Path, class_ids: Sequence[int]) -> Picture:
    """One image and its labels; `class_ids` as in read_yolo_labels. A folder difficult/ beside that of the labels is read too."""
    image = cv2.imread(str(image_path), cv2.IMREAD_COLOR)
    if image is None:
        raise DataError(f"Cannot read the image {image_path}.")
    boxes, classes = read_yolo_labels(label_path, image.shape[1], image.shape[0], class_ids)
    labelled = [class_id for class_id in class_ids if class_id >= 0]
    picture = Picture(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), boxes, classes, labelled, image_path.stem)
    difficult = label_path.parent.parent / "difficult" / label_path.name
    if difficult.exists():
        picture.difficult, picture.difficult_classes = read_yolo_labels(difficult, image.shape[1], image.shape[0], class_ids)
    return picture


def read_folder(images: Path, labels: Path, class_ids: Sequence[int]) -> List[Picture]:
    """All images of a folder in the natural order of their names."""
    paths = list_pictures(images)
    if not paths:
        raise DataError(f"The folder {images} holds no .jpg, .jpeg or .png image.")
    return [read_picture(path, labels / (path.stem + ".txt"), class_ids) for path in paths]


def read_names(path: Path) -> List[str]:
    """Names of classes, one per line."""
    return read_text(path).split()


def read_class_names(folder: Path) -> List[str]:
    """The names of a labelled folder's classes, in the order of its label files."""
    return read_names(folder / "classes.txt")


def read_labelled_folder(folder: Path, classes: Sequence[str] = CLASSES) -> List[Picture]:
    """The pictures of a folder with images, labels and classes.txt; its classes are found in `classes` by their names.

    A file labelled_classes.txt beside it names the classes of which every object is labelled; without one, all are.
    """
    names = read_class_names(folder)
    class_ids = [list(classes).index(name) if name in classes else -1 for name in names]
    pictures = read_folder(folder / "images", folder / "labels", class_ids)
    if (folder / LABELLED_CLASSES).exists():
        labelled = read_names(folder / LABELLED_CLASSES)
        if not labelled or not set(labelled) <= set(names):
            raise DataError(f"{folder / LABELLED_CLASSES} must name some of the classes {', '.join(names)}.")
        for picture in pictures:
            picture.labelled_classes = [list(classes).index(name) for name in labelled if name in classes]
    return pictures


def read_simulated(root: Path) -> List[Picture]:
    """The frames of all labelled drives (images, labels, classes.txt) below `root`."""
    drives = sorted(path.parent for path in root.glob("*/classes.txt"))
    if not drives:
        raise DataError(f"No labelled drive (*/classes.txt) below the folder {root}.")
    pictures = [picture for drive in drives for picture in read_labelled_folder(drive)]
    weigh_by_rarest_class(pictures)
    return pictures


def with_own_classes(folders: Sequence[Path]) -> Tuple[str, ...]:
    """CLASSES, and after them what the user's own folders add, in the order in which it appears."""
    names = list(CLASSES)
    for folder in folders:
        for name in read_class_names(folder):
            if not re.fullmatch(CLASS_NAME, name):
                raise DataError(f"{folder / 'classes.txt'} has the class '{name}', accepted is {CLASS_NAME}.")
            names += [name] if name not in names else []
    return tuple(names)


def read_own(folders: Sequence[Path], classes: Sequence[str]) -> Dict[str, List[Picture]]:
    """The pictures of the user's own folders, a group of its own for each: they may label other classes."""
    groups = {f"own:{number}": read_labelled_folder(folder, classes) for number, folder in enumerate(folders)}
    weigh_by_rarest_class([picture for pictures in groups.values() for picture in pictures])
    return groups


def weigh_by_rarest_class(pictures: List[Picture]) -> None:
    """Draw pictures of rare classes more often, by the root of how much rarer they are than the most frequent."""
    counts = np.zeros(1 + max((int(picture.classes.max()) for picture in pictures if len(picture.classes)), default=0))
    for picture in pictures:
        counts[np.unique(picture.classes)] += 1
    rarity = np.sqrt(counts.max() / np.maximum(counts, 1))
    for picture in pictures:
        picture.weight = float(rarity[picture.classes].max()) if len(picture.classes) else 1.0


def read_drive(section: Path) -> List[DriveFrame]:
    """The frames of one survey section, sorted by chainage (metres along the road)."""
    try:
        table = csv.DictReader(read_text(section / "frames.csv").splitlines())
        rows = [(float(row["chainage_m"]), row["frame"]) for row in table]
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"Cannot read {section / 'frames.csv'}: {error!r}.") from error
    if any(not math.isfinite(chainage_m) for chainage_m, _ in rows):
        raise DataError(f"{section / 'frames.csv'} has a chainage that is no finite number.")
    pictures = PictureFolder(section / "images")
    return [
        DriveFrame(
            read_picture(pictures.find(frame) or section / "images" / f"{frame}.jpg", section / "labels" / f"{frame}.txt", [POTHOLE]),
            chainage_m,
        )
        for chainage_m, frame in sorted(rows)
    ]


def is_none(data: Path) -> bool:
    """Whether --data says that there are no data sets of others."""
    return str(data) == "none"


def section_folders(data: Path) -> List[Path]:
    """Folders of all survey sections."""
    folders = sorted(path.parent for path in (data / "road_survey").glob("*/frames.csv"))
    if not folders:
        raise DataError(f"No survey section (road_survey/*/frames.csv) below the data folder {data}.")
    return folders


def read_validation_drives(data: Path) -> Dict[str, List[DriveFrame]]:
    """The validation drives by section name."""
    if is_none(data):
        return {}
    return {path.name: read_drive(path) for path in section_folders(data) if path.name in VALIDATION_SECTIONS}


def read_validation_cones(data: Path) -> List[Picture]:
    """The validation photos of traffic cones."""
    if is_none(data):
        return []
    cones = data / "traffic_cones"
    return read_folder(cones / "images" / "val", cones / "labels" / "val", [TRAFFIC_CONE])


def read_training_pictures(data: Path) -> Dict[str, List[Picture]]:
    """Training pictures by group: survey frames with and without potholes, close-ups, cone photos."""
    frames = []
    for folder in section_folders(data):
        if folder.name in VALIDATION_SECTIONS:
            continue
        drive = [frame.picture for frame in read_drive(folder)]
        for picture in drive:
            # A long section shows one road many times over: its share grows with the root of its length.
            picture.weight = len(drive) ** -0.5
        frames += drive
    cones = data / "traffic_cones"
    closeups = data / "pothole_closeups"
    return {
        "survey_potholes": [picture for picture in frames if len(picture.boxes)],
        "survey_empty": [picture for picture in frames if not len(picture.boxes)],
        "closeups": read_folder(closeups / "images", closeups / "labels", [POTHOLE]),
        "cones": read_folder(cones / "images" / "train", cones / "labels" / "train", [TRAFFIC_CONE]),
    }
