"""Readers of the data sets: survey drives, close-ups of potholes, street photos with cones.

Images are kept decoded in memory (about 1.2 GB in all): decoding anew for every draw would cost
more than the network on a CPU.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List

import cv2
import numpy as np

from . import CLASSES

VALIDATION_SECTIONS = ("386RS169832", "251BDF0530", "080BDF0070", "290RS070691")
"""Drives that are never trained on; the split is fixed by the data's README."""

POTHOLE, TRAFFIC_CONE = CLASSES.index("pothole"), CLASSES.index("traffic_cone")


class DataError(Exception):
    """A data folder is missing or not as its layout says; the text is one sentence for the user."""


@dataclass
class Picture:
    """One labelled image. `labelled_class` is the only class whose absence means anything here."""

    image: np.ndarray  # H x W x 3 uint8, RGB
    boxes: np.ndarray  # N x 4 float32 corners in pixels
    labelled_class: int
    name: str = ""
    weight: float = 1.0  # how often to draw it, relative to others of its group


@dataclass
class DriveFrame:
    """A picture at its place along the road."""

    picture: Picture
    chainage_m: float


def read_yolo_labels(path: Path, width: int, height: int) -> np.ndarray:
    """A label file (class cx cy w h per line, fractions of the image) to N x 4 corners in pixels."""
    try:
        rows = [[float(value) for value in line.split()] for line in path.read_text().splitlines() if line.strip()]
    except (OSError, ValueError) as error:
        raise DataError(f"Cannot read the labels {path}: {error}.") from error
    if any(len(row) != 5 for row in rows):
        raise DataError(f"The label file {path} has a line without exactly 5 numbers (class cx cy w h).")
    if not rows:
        return np.zeros((0, 4), np.float32)
    centres_and_sizes = np.array(rows)[:, 1:] * [width, height, width, height]
    centres, half_sizes = centres_and_sizes[:, :2], centres_and_sizes[:, 2:] / 2
    return np.hstack([centres - half_sizes, centres + half_sizes]).astype(np.float32)


def read_picture(image_path: Path, label_path: Path, labelled_class: int) -> Picture:
    """One image and its labels."""
    image = cv2.imread(str(image_path), cv2.IMREAD_COLOR)
    if image is None:
        raise DataError(f"Cannot read the image {image_path}.")
    boxes = read_yolo_labels(label_path, image.shape[1], image.shape[0])
    return Picture(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), boxes, labelled_class, image_path.stem)


def read_folder(images: Path, labels: Path, labelled_class: int) -> List[Picture]:
    """All JPEG images of a folder in the order of their names."""
    paths = sorted(images.glob("*.jpg"))
    if not paths:
        raise DataError(f"The folder {images} holds no .jpg image.")
    return [read_picture(path, labels / (path.stem + ".txt"), labelled_class) for path in paths]


def read_drive(section: Path) -> List[DriveFrame]:
    """The frames of one survey section, sorted by chainage (metres along the road)."""
    try:
        with open(section / "frames.csv", newline="") as file:
            rows = [(float(row["chainage_m"]), row["frame"]) for row in csv.DictReader(file)]
    except (OSError, KeyError, ValueError) as error:
        raise DataError(f"Cannot read {section / 'frames.csv'}: {error}.") from error
    return [
        DriveFrame(
            read_picture(section / "images" / f"{frame}.jpg", section / "labels" / f"{frame}.txt", POTHOLE),
            chainage_m,
        )
        for chainage_m, frame in sorted(rows)
    ]


def section_folders(data: Path) -> List[Path]:
    """Folders of all survey sections."""
    folders = sorted(path.parent for path in (data / "road_survey").glob("*/frames.csv"))
    if not folders:
        raise DataError(f"No survey section (road_survey/*/frames.csv) below the data folder {data}.")
    return folders


def read_validation_drives(data: Path) -> Dict[str, List[DriveFrame]]:
    """The validation drives by section name."""
    return {path.name: read_drive(path) for path in section_folders(data) if path.name in VALIDATION_SECTIONS}


def read_validation_cones(data: Path) -> List[Picture]:
    """The validation photos of traffic cones."""
    cones = data / "traffic_cones"
    return read_folder(cones / "images" / "val", cones / "labels" / "val", TRAFFIC_CONE)


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
        "closeups": read_folder(closeups / "images", closeups / "labels", POTHOLE),
        "cones": read_folder(cones / "images" / "train", cones / "labels" / "train", TRAFFIC_CONE),
    }
