"""Pairs of street photos at full resolution: small things come and go on the road ahead, and all else differs by parallax and light.

A pair is one photo twice, of which one is seen through an uneven flow as of a camera that stands elsewhere, or two photos
of one place from a set, registered onto each other. Things are hazards cut out of other photos, and shapes of any texture:
what lies on a road is seldom of a class that one has pictures of.
"""

from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Dict, List, Sequence, Tuple

import cv2
import numpy as np
import yaml

from common.files import DataError, read_text
from common.pasting import CutOut, Ground, cast_contact_shadow, paste
from detector import CLASSES as HAZARDS
from detector import sets
from detector.cutouts import CAMERA_M, HEIGHTS_M, HORIZON, read_cut_outs

from . import registration
from .classes import CLASSES, NO_CHANGE
from .data import IGNORED, shrink

CLASS_OF = {
    "traffic_cone": "traffic_cone", "barrier": "barrier", "debris": "rubbish", "deer": "other_objects",
    "construction_machine": "construction", "stopped_accident": "vehicle",
}
"""Of the detector's hazards, what they are as a change."""

WIDTH = 960
"""Photos are no wider."""

ROAD = ((0.35, 0.42), (0.65, 0.42), (1.0, 0.8), (1.0, 1.0), (0.0, 1.0), (0.0, 0.8))
"""Where the road may be, as shares of a picture's width and height: `road` of livemap evaluate change --region."""

MOST_THINGS = 6
FATES = ("stays", "appears", "vanishes", "replaced")
FATE_SHARES = (0.25, 0.35, 0.35, 0.05)
SHAPES = 0.45
"""Of the things, how many are shapes."""

ROWS = (0.035, 0.5)
"""How far below the horizon a thing's foot is, in heights of the picture."""

REAL_PAIRS = 0.35
"""Of the samples, where there are any."""

LEAST_INLIERS = 60
"""Of two photos of one place: wrong ones have few."""


@dataclass
class RoadPhoto:
    """A street as a driver sees it, and the boxes (N x 4, pixels) of hazards that stand in it."""

    image: np.ndarray
    boxes: np.ndarray


@dataclass
class PlacePair:
    """Two photos of one place by their numbers: the homography takes the first one's pixels to the second's."""

    first: int
    second: int
    homography: np.ndarray


def pictures_of_pairs(path: Path) -> Tuple[str, List[str]]:
    """The set, and those of its pictures that pairs of the file (training/change_pairs.yaml) are made of: never trained on."""
    try:
        content = yaml.safe_load(read_text(path))
        names = [str(name) for part in ("looked_at", "measured_once") for name in content[part]]
        return str(content["set"]), sorted({f"{content['picture']}{number}" for name in names for number in name.split("_")})
    except (KeyError, TypeError, yaml.YAMLError) as error:
        raise DataError(f"Cannot read the pairs {path}: {error!r}.") from error


def road_mask(height: int, width: int) -> np.ndarray:
    """H x W uint8, 1 where the road may be."""
    mask = np.zeros((height, width), np.uint8)
    cv2.fillPoly(mask, [np.round(np.array(ROAD) * [width, height]).astype(np.int32)], 1)
    return mask


def places_in(photos: Sequence[RoadPhoto], offset: int) -> List[PlacePair]:
    """All pairs of photos that match as two views of one road do; `offset` is the number of the first photo."""
    sift = cv2.SIFT_create(1500, contrastThreshold=0.02)
    seen = [sift.detectAndCompute(cv2.cvtColor(photo.image, cv2.COLOR_RGB2GRAY), None) for photo in photos]
    found = []
    for one, other in combinations(range(len(photos)), 2):
        homography, inliers = registration.match(seen[one], seen[other])
        if homography is not None and inliers >= LEAST_INLIERS and registration.overlap(homography, *photos[one].image.shape[1::-1]) > 0.6:
            found.append(PlacePair(offset + one, offset + other, homography))
    return found


def draw_shape(rng: np.random.Generator, photos: Sequence[RoadPhoto]) -> CutOut:
    """A lump, a board or a bar with the texture of any place of any photo, in any colour."""
    high, wide = int(rng.integers(24, 72)), int(rng.integers(24, 72))
    photo = photos[rng.integers(len(photos))].image
    top, left = (int(rng.integers(0, size - part)) for size, part in zip(photo.shape, (high, wide)))
    patch = photo[top : top + high, left : left + wide].astype(np.float32)
    patch = (patch - patch.mean()) * rng.uniform(0.3, 1.2) + rng.uniform(15, 235) + rng.uniform(-35, 35, 3)
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(4, 10)))
    reach = rng.uniform(0.6, 1.0, len(angles))
    outline = np.stack([np.cos(angles) * reach, np.sin(angles) * reach], axis=1) * 0.5 + 0.5
    if rng.random() < 0.3:  # a box, seen from somewhat above
        lift = rng.uniform(0, 0.3)
        outline = np.array([[lift, 0], [1, 0], [1, 1 - lift], [1 - lift, 1], [0, 1], [0, lift]])
    alpha = np.zeros((high, wide), np.uint8)
    cv2.fillPoly(alpha, [np.round(outline * [wide - 1, high - 1]).astype(np.int32)], 255)
    shade = np.linspace(rng.uniform(0.9, 1.2), rng.uniform(0.5, 1.0), high, dtype=np.float32)[:, None, None]
    return CutOut(np.dstack([(patch * shade).clip(0, 255).astype(np.uint8), alpha]), CLASSES.index("rubbish"))


def draw_flow(rng: np.random.Generator, height: int, width: int, horizon: float) -> Tuple[np.ndarray, np.ndarray]:
    """Where each pixel of a view from elsewhere comes from: the road nearly in place, what stands above it nearer or farther."""
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    upright = 1 / (1 + np.exp((y - horizon - 0.03 * height) / (0.02 * height)))
    zoom = rng.uniform(-0.06, 0.06) * upright
    waves = [
        cv2.resize(rng.normal(0, strength, (5, 8)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
        for strength in rng.uniform(0, 2.5, 2)
    ]
    return x + (x - width * rng.uniform(0.4, 0.6)) * zoom + waves[0], y + (y - horizon) * zoom + 0.7 * waves[1]


def compressed(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """Through a JPEG, half of the time."""
    if rng.random() < 0.5:
        return image
    return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(45, 96))])[1], cv2.IMREAD_COLOR)


@dataclass
class Roads:
    """What pairs are drawn from."""

    photos: List[RoadPhoto]
    cut_outs: Dict[int, List[CutOut]]  # by class of change
    places: List[PlacePair] = field(default_factory=list)

    def draw(self, rng: np.random.Generator) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First picture, in the second one's view, second picture and mask (H x W uint8), in a size between the network's and a photo's."""
        pictures, ignored, flow, ground = self.draw_views(rng)
        height, width = ignored.shape
        shown = [np.zeros((height, width), np.int32) for _ in pictures]
        class_of, change_of = self.put_things(rng, pictures, shown, ground)
        if flow is not None:
            pictures[0] = cv2.remap(pictures[0], *flow, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            shown[0] = cv2.remap(shown[0].astype(np.uint8), *flow, cv2.INTER_NEAREST).astype(np.int32)
        before, after = shown
        mask = np.where(change_of[after], class_of[after], np.where(change_of[before], class_of[before], NO_CHANGE))
        mask = np.where((ignored > 0) & (mask == NO_CHANGE), IGNORED, mask).astype(np.uint8)
        scale = float(np.exp(rng.uniform(np.log(0.36), np.log(0.75)))) * WIDTH / max(width, 640)
        size = max(round(width * scale), 240), max(round(height * scale), 200)
        first, second = (compressed(rng, cv2.resize(picture, size, interpolation=cv2.INTER_AREA)) for picture in pictures)
        return first, second, cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST)

    def draw_views(self, rng: np.random.Generator):
        """Both pictures without things, H x W uint8 of what is not known to be unchanged, the flow (or None), and the ground."""
        horizon, camera_m = float(rng.uniform(*HORIZON)), float(rng.uniform(*CAMERA_M))
        if self.places and rng.random() < REAL_PAIRS:
            pair = self.places[rng.integers(len(self.places))]
            first, second = self.photos[pair.first], self.photos[pair.second]
            height, width = second.image.shape[:2]
            seen = cv2.warpPerspective(boxes_filled(first), pair.homography, (width, height), borderValue=255)
            ignored = np.maximum(np.maximum(seen, boxes_filled(second)), 1 - road_mask(height, width))
            aligned = cv2.warpPerspective(first.image, pair.homography, (width, height), borderMode=cv2.BORDER_REPLICATE)
            return [aligned, second.image.copy()], ignored, None, Ground(float(rng.uniform(0.41, 0.46)) * height, 1.25)
        photo = self.photos[rng.integers(len(self.photos))]
        height, width = photo.image.shape[:2]
        flow = draw_flow(rng, height, width, horizon * height)
        return [photo.image.copy(), photo.image.copy()], np.zeros((height, width), np.uint8), flow, Ground(horizon * height, camera_m)

    def put_things(self, rng: np.random.Generator, pictures: List[np.ndarray], shown: List[np.ndarray], ground: Ground) -> Tuple[np.ndarray, np.ndarray]:
        """Things onto the road, in place, the farthest first; the class and whether it is a change, by the numbers in `shown`."""
        height, width = shown[0].shape
        classes, changed = [NO_CHANGE], [False]
        for below in np.sort(np.exp(rng.uniform(*np.log(ROWS), rng.integers(1, MOST_THINGS + 1)))) * height:
            fate = FATES[rng.choice(len(FATES), p=FATE_SHARES)]
            foot = width * (0.5 + rng.uniform(-1, 1) * (0.14 + 0.4 * below / (0.45 * height))), ground.horizon_px + below
            darkness = float(rng.uniform(0, 0.5))
            for which in range(2):
                if (fate, which) in (("appears", 0), ("vanishes", 1)):
                    continue
                if which == 0 or fate in ("appears", "replaced"):
                    thing, object_m = self.draw_thing(rng)
                    gain, mirrored = float(rng.uniform(0.6, 1.3)), bool(rng.random() < 0.5)
                    classes.append(thing.class_id)
                    changed.append(fate != "stays")
                tall = float(np.clip(ground.height_px(object_m, foot[1]), 4.0, 2 * thing.rgba.shape[0]))
                wide = tall * thing.rgba.shape[1] / thing.rgba.shape[0]
                if rng.random() < 0.7:
                    cast_contact_shadow_near(pictures[which], foot, wide, darkness)
                paste(pictures[which], shown[which], thing, len(classes) - 1, foot, tall, gain, mirrored)
        return np.array(classes, np.uint8), np.array(changed)

    def draw_thing(self, rng: np.random.Generator) -> Tuple[CutOut, float]:
        """A thing and its height in metres."""
        if not self.cut_outs or rng.random() < SHAPES:
            shape = draw_shape(rng, self.photos)
            # As wide as it may: boards and bars lie flat.
            squeeze = float(np.exp(rng.uniform(-1.3, 0.5)))
            return CutOut(stretched(shape.rgba, squeeze), shape.class_id), 0.35 * float(np.exp(rng.uniform(-0.7, 0.6))) * min(squeeze, 1.0)
        classes = sorted(self.cut_outs)
        shares = np.array([3.0 if CLASSES[class_id] == "rubbish" else 0.3 if CLASSES[class_id] in ("construction", "vehicle") else 1.0 for class_id in classes])
        class_id = classes[rng.choice(len(classes), p=shares / shares.sum())]
        one = self.cut_outs[class_id][rng.integers(len(self.cut_outs[class_id]))]
        return one, HEIGHT_OF[class_id] * float(np.exp(rng.uniform(-0.5, 0.4)))


HEIGHT_OF = {CLASSES.index(ours): HEIGHTS_M[theirs] for theirs, ours in CLASS_OF.items()}


def stretched(rgba: np.ndarray, squeeze: float) -> np.ndarray:
    """Lower by that factor, as wide."""
    return cv2.resize(rgba, (rgba.shape[1], max(round(rgba.shape[0] * squeeze), 4)), interpolation=cv2.INTER_AREA)


def cast_contact_shadow_near(image: np.ndarray, foot: Tuple[float, float], width_px: float, darkness: float) -> None:
    """cast_contact_shadow on the part of the picture that it reaches, in place."""
    reach = int(1.2 * width_px) + 4
    left, top = max(int(foot[0]) - reach, 0), max(int(foot[1]) - reach, 0)
    part = image[top : int(foot[1]) + reach, left : int(foot[0]) + reach]
    if part.size:
        cast_contact_shadow(part, (foot[0] - left, foot[1] - top), width_px, darkness)


def boxes_filled(photo: RoadPhoto) -> np.ndarray:
    """H x W uint8, 1 where a labelled hazard stands, and a little around it."""
    mask = np.zeros(photo.image.shape[:2], np.uint8)
    for left, top, right, bottom in photo.boxes:
        mask[max(int(top) - 4, 0) : int(bottom) + 5, max(int(left) - 4, 0) : int(right) + 5] = 1
    return mask


def read_roads(data: Path, catalogue_path: Path, pairs_path: Path) -> Roads:
    """Street photos of the sets' training parts, hazards cut out of them, and the places that the pairs' set shows twice."""
    catalogue = sets.read_catalogue(catalogue_path)
    place_set, kept_apart = pictures_of_pairs(pairs_path)
    cut: Dict[int, List[CutOut]] = {}
    photos: List[RoadPhoto] = []
    places: List[PlacePair] = []
    for one in catalogue.sets:
        skipped = one.skip + tuple(kept_apart) if one.name == place_set else one.skip
        pictures = sets.read_split(replace(one, skip=skipped), data, catalogue.rename).training
        for class_id, found in read_cut_outs([pictures]).items():
            ours = CLASSES.index(CLASS_OF[HAZARDS[class_id]])
            cut.setdefault(ours, []).extend(CutOut(each.rgba, ours) for each in found)
        if one.background:
            begun = len(photos)
            photos += [as_road_photo(picture) for picture in pictures]
            if one.name == place_set:
                places = places_in(photos[begun:], begun)
    return Roads(photos, cut, places)


def as_road_photo(picture) -> RoadPhoto:
    """A picture of a set, no wider than WIDTH."""
    image = shrink(picture.image, WIDTH)
    return RoadPhoto(image, picture.boxes * (image.shape[1] / picture.image.shape[1]))
