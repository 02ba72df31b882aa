"""Readers: pairs in VL-CMU-CD's layout, what stands in simulated streets, photos of roads, and cut-out objects.

Pictures are kept decoded, in the size of the network's input (pairs, about 0.6 MB each) or somewhat larger (photos).
"""

import csv
import hashlib
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import cv2
import numpy as np
import yaml

from common.files import DataError, PictureFolder, list_pictures, read_text
from detector.data import VALIDATION_SECTIONS

from . import registration
from .classes import CLASSES, COLOURS, MISCELLANEOUS, NO_CHANGE
from .inference import INPUT_HEIGHT, INPUT_WIDTH, letterbox

IGNORED = 255
"""In a mask: neither changed nor unchanged."""

MOST_UNKNOWN = 0.01
"""Of a mask's pixels, how many may have colours of no class, as where outlines were smoothed."""

PLANE_DEPTHS_M = (9.0, 14.0, 25.0)
"""Walls onto which a pair of known poses is registered where the pictures do not match."""

VALIDATION_SIGNS = 5
"""Every so-many-th crop of a kind of sign is kept for validation."""


@dataclass
class Pair:
    """Two pictures of one place, in the network's size, and what changed as the second sees it."""

    first: np.ndarray  # H x W x 3 uint8, RGB
    second: np.ndarray
    mask: np.ndarray  # H x W uint8, into CLASSES, or IGNORED
    homography: Optional[np.ndarray]  # first's pixels to the second's, from what they show; None: they do not match
    fallbacks: List[np.ndarray]  # the same from poses, where known
    name: str = ""
    content: Tuple[int, int] = (INPUT_HEIGHT, INPUT_WIDTH)  # rows and columns; what lies beyond is padding

    def register(self) -> Optional[np.ndarray]:
        """As a vehicle would, without looking at the padding."""
        rows, columns = self.content
        return registration.as_on_board(self.first[:rows, :columns], self.second[:rows, :columns])

    def homographies(self) -> List[np.ndarray]:
        """What the pair may be registered with in training: as a vehicle would, else by poses."""
        return [self.homography] if self.homography is not None else self.fallbacks


@dataclass
class Scene:
    """One picture and the class of each pixel's object (H x W uint8, 0: none that can change)."""

    image: np.ndarray
    classes: np.ndarray


def read_image(path: Path) -> np.ndarray:
    """H x W x 3 uint8, RGB."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise DataError(f"Cannot read the image {path}.")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def is_grey(stored: np.ndarray) -> bool:
    """Whether a mask has one channel, or colours that are all black, white or between."""
    return stored.ndim == 2 or bool((stored[..., 0] == stored[..., 1]).all() and (stored[..., 1] == stored[..., 2]).all())


def is_ambiguous(stored: np.ndarray) -> bool:
    """Whether a mask in colour could be one of change and no change, or of indices: it is grey, and not all white."""
    return is_grey(stored) and bool((stored[..., :3] != 255).any())


def has_neighbour_with_classes(path: Path) -> bool:
    """Whether another mask of the folder has classes, which tells what black and white, or 0 and 255, are in all."""
    stored = (cv2.imread(str(other), cv2.IMREAD_UNCHANGED) for other in list_pictures(path.parent))
    return any(mask is not None and (not is_grey(mask) or mask.ndim == 2 and np.isin(mask, range(1, len(CLASSES))).any()) for mask in stored)


def read_mask(path: Path) -> np.ndarray:
    """A ground truth, of indices (one channel) or in the published colours (three or four), to H x W uint8."""
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if stored is None:
        raise DataError(f"Cannot read the mask {path}.")
    if stored.dtype != np.uint8:
        raise DataError(f"The mask {path} has {8 * stored.itemsize} bits, accepted are 8.")
    if stored.ndim == 2:
        if (stored[stored != IGNORED] >= len(CLASSES)).any():
            raise DataError(f"The mask {path} has a value that is neither a class (0 to {len(CLASSES) - 1}) nor {IGNORED}.")
        if IGNORED in stored and set(np.unique(stored)) <= {NO_CHANGE, IGNORED} and not has_neighbour_with_classes(path):
            raise DataError(f"The mask {path} says change or not (0 and 255 alone); training needs classes.")
        return stored.astype(np.uint8)
    if stored.shape[2] == 4 and (stored[..., 3] != 255).any():
        raise DataError(f"The mask {path} has transparent pixels, accepted is a mask without any.")
    if is_ambiguous(stored) and not has_neighbour_with_classes(path):
        raise DataError(
            f"The mask {path} has three channels that are all black, white or grey, which may mean change in white or the published "
            "colours (white: no change), accepted are one channel or colours."
        )
    rgb = stored[..., 2::-1].astype(np.int32)
    codes = (rgb[..., 0] << 16) + (rgb[..., 1] << 8) + rgb[..., 2]
    mask = np.full(codes.shape, IGNORED, np.uint8)
    known = list(enumerate(COLOURS)) + [(CLASSES.index("rubbish"), MISCELLANEOUS)]
    for index, (red, green, blue) in known:
        mask[codes == (red << 16) + (green << 8) + blue] = index
    unknown = int(((mask == IGNORED) & (codes != 0)).sum())
    if unknown > MOST_UNKNOWN * mask.size:
        raise DataError(f"The mask {path} has {unknown} of {mask.size} pixels in colours of no class, accepted is up to one in a hundred.")
    return mask


def fitted_size(height: int, width: int) -> Tuple[int, int]:
    """Rows and columns of a picture in the network's input."""
    scale = min(INPUT_WIDTH / width, INPUT_HEIGHT / height)
    return round(height * scale), round(width * scale)


def fit_mask(mask: np.ndarray) -> np.ndarray:
    """A mask in the network's size; the padding is ignored."""
    fitted = np.full((INPUT_HEIGHT, INPUT_WIDTH), IGNORED, np.uint8)
    height, width = fitted_size(*mask.shape)
    fitted[:height, :width] = cv2.resize(mask, (width, height), interpolation=cv2.INTER_NEAREST)
    return fitted


def pair_paths(root: Path) -> List[Path]:
    """The ground truths (.../NNN/GT/gtII.png) of all pairs below a folder, in order."""
    folders = sorted(path for path in root.glob("**/GT") if path.is_dir())
    paths = [path for folder in folders for path in list_pictures(folder) if path.stem.startswith("gt") and path.stem != "gt"]
    if not paths:
        raise DataError(f"No pair (NNN/GT/gtII.png) below the folder {root}.")
    return paths


def read_poses(data_set: Path) -> Dict[str, np.ndarray]:
    """(2, 7) poses of both passes by pair ("NNN/II"), empty where there is no poses.csv."""
    path = data_set / "poses.csv"
    if not path.is_file():
        return {}
    parts = ("tx", "ty", "tz", "qx", "qy", "qz", "qw")
    try:
        return {
            row["pair"]: np.array([[float(row[f"{which}_{part}"]) for part in parts] for which in ("first", "second")])
            for row in csv.DictReader(read_text(path).splitlines())
        }
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"Cannot read {path}: {error!r}.") from error


def read_intrinsics(data_set: Path) -> Optional[np.ndarray]:
    """3 x 3 intrinsics in pixels of the network's input, where camera.yaml says them."""
    path = data_set / "camera.yaml"
    if not path.is_file():
        return None
    try:
        content = yaml.safe_load(read_text(path))
        scale = min(INPUT_WIDTH / content["width"], INPUT_HEIGHT / content["height"])
        return registration.camera_matrix(*(float(content[key]) * scale for key in ("fx", "fy", "cx", "cy")))
    except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise DataError(f"Cannot read {path}: {error!r}.") from error


def read_pair(truth: Path, poses: Dict[str, np.ndarray], intrinsics: Optional[np.ndarray]) -> Pair:
    """One pair by its ground truth's path."""
    pictures, number = truth.parent.parent / "RGB", truth.stem[2:]
    folder = PictureFolder(pictures)
    first, second = (read_image(folder.find(f"{which}_{number}") or pictures / f"{which}_{number}.png") for which in (1, 2))
    content = fitted_size(*second.shape[:2])
    pose = poses.get(f"{truth.parent.parent.name}/{number}")
    fallbacks = []
    if pose is not None and intrinsics is not None:
        fallbacks = [registration.by_plane(pose[0], pose[1], intrinsics, depth_m) for depth_m in PLANE_DEPTHS_M]
    return Pair(letterbox(first), letterbox(second), fit_mask(read_mask(truth)), None, fallbacks, str(truth), content)


class Registrations:
    """Homographies of pairs by what their pictures show, kept in a file because they take longer than reading."""

    def __init__(self, path: Optional[Path]):
        self.path, self.known, self.fresh = path, {}, False
        if path is not None and path.is_file():
            try:
                with np.load(path) as stored:
                    self.known = {name: stored[name] for name in stored.files}
            except (OSError, ValueError, zipfile.BadZipFile) as error:
                raise DataError(f"Cannot read the kept registrations {path}: {error}; delete it.") from error

    def of(self, pair: Pair) -> Optional[np.ndarray]:
        """As Pair.register; each pair is registered once."""
        key = hashlib.blake2b(pair.first.tobytes() + pair.second.tobytes(), digest_size=16).hexdigest()
        if key not in self.known:
            found, self.fresh = pair.register(), True
            self.known[key] = np.zeros((0, 3)) if found is None else found
        return self.known[key] if len(self.known[key]) else None

    def keep(self) -> None:
        """Write what is new; a kill at any moment leaves the old file or the new one."""
        if self.path is None or not self.fresh:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        temporary = self.path.with_suffix(".tmp.npz")
        np.savez(temporary, **self.known)
        os.replace(temporary, self.path)


def read_pairs(root: Path, cache: Optional[Path] = None, registered: bool = False) -> List[Pair]:
    """All pairs below a folder, registered; `cache` is where Registrations are kept.

    With `registered` the pictures of a pair lie upon each other already.
    """
    pairs, data_sets, registrations = [], {}, Registrations(cache)
    for path in pair_paths(root):
        # NNN/GT/gtII.png, in a simulated data set below raw/.
        data_set = path.parents[3]
        if data_set not in data_sets:
            data_sets[data_set] = read_poses(data_set), read_intrinsics(data_set)
        pair = read_pair(path, *data_sets[data_set])
        pair.name = str(path.relative_to(root))
        pair.homography = np.eye(3) if registered else registrations.of(pair)
        pairs.append(pair)
    registrations.keep()
    return pairs


def read_scenes(root: Path) -> List[Scene]:
    """What stands in the streets of training/simulate_change.py: pictures of `none` with the masks of `all`."""
    scenes = []
    for mask_path in sorted(root.glob("*/all/raw/*/GT/gt*.png")):  # As simulate_change.py writes them.
        street = mask_path.parents[4]
        picture = street / "none" / "raw" / mask_path.parents[1].name / "RGB" / f"2_{mask_path.stem[2:]}.png"
        if picture.is_file():
            scenes.append(Scene(letterbox(read_image(picture)), fit_mask(read_mask(mask_path))))
    return scenes


def read_photos(data: Path, validation: bool) -> Dict[str, List[np.ndarray]]:
    """Photos of roads by where they come from: survey drives (every third frame) and street photos."""
    sections = sorted(path.parent for path in (data / "road_survey").glob("*/frames.csv"))
    frames = [
        path for section in sections if (section.name in VALIDATION_SECTIONS) == validation
        for path in list_pictures(section / "images")[::3]
    ]
    streets = list_pictures(data / "traffic_cones" / "images" / ("val" if validation else "train"))
    if not frames or not streets:
        raise DataError(f"The folder {data} lacks photos (road_survey/*/images, traffic_cones/images).")
    return {"survey": [shrink(read_image(path)) for path in frames], "streets": [shrink(read_image(path)) for path in streets]}


def shrink(image: np.ndarray, width: int = 420) -> np.ndarray:
    """A photo no wider than that."""
    if image.shape[1] <= width:
        return image
    return cv2.resize(image, (width, round(image.shape[0] * width / image.shape[1])), interpolation=cv2.INTER_AREA)
