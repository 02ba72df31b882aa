"""Which frames hold a hazard that would be reported, and pictures made ready for the classifier.

The rule: a labelled box counts when its foot, the middle of its lower edge, lies within MAX_RANGE_M of the vehicle on
the plane of the road, by the camera's file. Photos of unknown cameras have no such plane: there a box counts that is at
least PHOTO_LEAST_HEIGHT of the picture's width high, as a cone of 0.7 m is at 30 m through a lens of 50 degrees.
"""

import math
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

import cv2
import numpy as np
import yaml

from common.files import read_text
from detector import CLASSES, data
from detector.data import DataError, DriveFrame, Picture

from . import INPUT_HEIGHT, INPUT_WIDTH, MAX_RANGE_M

REPORTABLE, FAR = 0, 1
"""Classes of boxes here. The first is also the class that the augmentation gives to potholes that it pastes."""

PHOTO_LEAST_HEIGHT = 0.025
LEAST_HEIGHTS = {"debris": 0.011}
"""What lies on a road is 0.3 m high."""


class Background(Enum):
    """What is known about the places of a picture that nobody labelled."""

    KNOWN = 1  # no hazard is there
    LIKELY = 2  # none of some classes, and hardly one of the others: counts a little
    UNKNOWN = 3


SURVEY_CAMERA = Path(__file__).parents[2] / "config" / "cameras" / "road_survey.yaml"

CALIBRATION_SECTIONS = ("386RS191729", "080BDF0090")
"""Training-side survey sections that the classifier never learns from: its threshold is chosen on them."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics of a rectified picture (pixels) and the camera's place above the road (metres, degrees)."""

    fx: float
    fy: float
    cx: float
    cy: float
    height_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float


def read_camera(path: Path) -> Camera:
    """A camera file as the simulator and the bag tools read it."""
    try:
        content: Dict[str, Any] = yaml.safe_load(read_text(path))
        lens = {name: float(content[name]) for name in ("fx", "fy", "cx", "cy")}
        mounting = {name: float(content["mounting"][name]) for name in ("height_m", "roll_deg", "pitch_deg", "yaw_deg")}
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise DataError(f"Cannot read the camera file {path}: {error!r}.") from error
    return Camera(**lens, **mounting)


def ground_distances_m(camera: Camera, boxes: np.ndarray) -> np.ndarray:
    """Horizontal distance of the boxes' feet (N x 4 corners, pixels) on the plane of the road; inf above the horizon."""
    feet = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=1)
    # x forward, y left, z up; the edge of a box lies half a pixel beyond the last pixel's centre.
    rays = np.stack(
        [np.ones(len(feet)), (camera.cx + 0.5 - feet[:, 0]) / camera.fx, (camera.cy + 0.5 - feet[:, 1]) / camera.fy], axis=1
    )
    roll, pitch, yaw = (math.radians(angle) for angle in (camera.roll_deg, camera.pitch_deg, camera.yaw_deg))
    about_x = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]])
    about_y = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    directions = rays @ (about_z @ about_y @ about_x).T
    down = -directions[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = camera.height_m * np.hypot(directions[:, 0], directions[:, 1]) / down
    return np.where(down > 1e-6, distances, np.inf)


def is_reportable(picture: Picture, camera: Optional[Camera]) -> np.ndarray:
    """Per box of a picture whether it counts, by the rule above."""
    if camera is not None:
        return ground_distances_m(camera, picture.boxes) <= MAX_RANGE_M
    heights = picture.boxes[:, 3] - picture.boxes[:, 1]
    least = np.array([LEAST_HEIGHTS.get(name, PHOTO_LEAST_HEIGHT) for name in CLASSES])
    return heights >= least[picture.classes] * picture.image.shape[1]


def prepared(picture: Picture, camera: Optional[Camera], background: Background = Background.KNOWN, zoom: float = 0.0) -> Picture:
    """The picture as the classifier sees it: shrunk, with boxes of class REPORTABLE or FAR instead of classes of hazards.

    `zoom`: how much larger it is than what just covers the input, so that views cut it; 0: it lies within the input.
    """
    classes = np.where(is_reportable(picture, camera), REPORTABLE, FAR).astype(np.int64)
    height, width = picture.image.shape[:2]
    fits = INPUT_WIDTH / width, INPUT_HEIGHT / height
    scale = zoom * max(fits) if zoom else min(fits)
    size = (round(width * scale), round(height * scale))
    image = cv2.resize(picture.image, size, interpolation=cv2.INTER_LINEAR)  # As the vehicle does it.
    boxes, difficult = (
        (corners * np.tile([size[0] / width, size[1] / height], 2)).astype(np.float32) for corners in (picture.boxes, picture.difficult)
    )
    every = range(len(CLASSES))
    return Picture(
        image, boxes, classes, every if background is Background.KNOWN else (), picture.name, picture.weight, difficult,
        np.full(len(difficult), FAR), every if background is Background.LIKELY else (),
    )


def read_simulated(root: Path) -> List[Tuple[str, List[Picture]]]:
    """Drives of training/simulate_drives.py by name, prepared with the camera file that lies in each."""
    drives = sorted(path.parent for path in root.glob("*/classes.txt"))
    if not drives:
        raise DataError(f"No labelled drive (*/classes.txt) below the folder {root}.")
    result = []
    for drive in drives:
        camera = read_camera(drive / "camera.yaml")
        names = read_text(drive / "classes.txt").split()
        class_ids = [CLASSES.index(name) if name in CLASSES else -1 for name in names]
        pictures = data.read_folder(drive / "images", drive / "labels", class_ids)
        result.append((drive.name, [prepared(picture, camera) for picture in pictures]))
    return result


def read_sections(folder: Path, wanted) -> Dict[str, List[DriveFrame]]:
    """Survey sections by name, those for which `wanted(name)` holds, prepared."""
    camera = read_camera(SURVEY_CAMERA)
    drives = {path.name: data.read_drive(path) for path in data.section_folders(folder) if wanted(path.name)}
    return {
        name: [DriveFrame(prepared(frame.picture, camera), frame.chainage_m) for frame in drive]
        for name, drive in drives.items()
    }


def is_training_section(name: str) -> bool:
    """Whether the classifier may learn from a section."""
    return name not in data.VALIDATION_SECTIONS and name not in CALIBRATION_SECTIONS


def read_calm_roads(folder: Path) -> List[Picture]:
    """Survey frames without a label, of the sections to learn from, as they are."""
    sections = [path for path in data.section_folders(folder) if is_training_section(path.name)]
    return [frame.picture for path in sections for frame in data.read_drive(path) if not len(frame.picture.boxes)]


def read_training_pictures(folder: Path, simulated: Optional[Path]) -> Dict[str, List[Picture]]:
    """Training pictures by the groups of the detector's augmentation; photos.py adds those of the sets."""
    frames = []
    for drive in read_sections(folder, is_training_section).values():
        for frame in drive:
            # A long section shows one road many times over: its share grows with the root of its length.
            frame.picture.weight = len(drive) ** -0.5
            frames.append(frame.picture)
    photos = folder / "traffic_cones"
    cones = data.read_folder(photos / "images" / "train", photos / "labels" / "train", [data.TRAFFIC_CONE])
    photos = folder / "pothole_closeups"
    closeups = data.read_folder(photos / "images", photos / "labels", [data.POTHOLE])
    groups = {
        "survey_potholes": [picture for picture in frames if len(picture.boxes)],
        "survey_empty": [picture for picture in frames if not len(picture.boxes)],
        "closeups": [prepared(photo, None) for photo in closeups],
        "cones": [prepared(photo, None) for photo in cones],
    }
    if simulated:
        groups["simulated"] = [picture for _, drive in read_simulated(simulated) for picture in drive]
    return groups


def holds_hazard(picture: Picture) -> bool:
    """Whether a prepared picture is to be sent."""
    return bool((picture.classes == REPORTABLE).any())
