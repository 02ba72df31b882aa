"""From pictures to training samples: views, mosaics, mixtures, pasted potholes, light, colour and blur.

Everything random comes from one numpy generator that the caller seeds per sample, so a sample
depends on (seed, epoch, index) alone: not on workers, not on an interrupted run.
"""

from dataclasses import dataclass, replace
from typing import Dict, List, Optional, Sequence, Tuple

import cv2
import numpy as np

from . import CLASSES, inference, sets
from . import boxes as box_math
from .data import POTHOLE, Picture

PAD_VALUE = 114
"""Grey level outside of pictures, as in inference."""

MIN_VISIBLE_FRACTION = 0.4
"""A label of which a view shows less is ignored: neither pothole nor background."""

MIN_SIZE_PX = (6.0, 3.0)
MIN_AREA_PX = 60.0
"""A label that a view shows smaller (width, height, or their product) is ignored."""

SMALL_SIZE_PX = (4.0, 3.0)
SMALL_AREA_PX = 16.0
"""The same for photos of a set and own ones: debris far ahead is a few pixels high."""


CLOSEUPS_AMONG_PASTED = 0.4
"""Share of pasted potholes that come from close-ups: every photo shows another road, a survey section always the same."""

MOST_CONTRAST_UNDER_PASTE = 18.0
"""Standard deviation of grey levels up to which a place takes a pasted pothole: road, not road markings."""


@dataclass(frozen=True)
class Recipe:
    """How strongly to change pictures. Probabilities are per sample."""

    mosaic: float = 0.5
    mix: float = 0.15
    paste: float = 0.65
    mirror: float = 0.5
    scale_spread: float = 1.6  # a group's scale is multiplied by up to this or divided by it
    aspect_spread: float = 1.12
    far: float = 0.25  # a photo of a set is shrunk, as if seen from farther away
    focus: float = 0.75  # a view is placed around a label rather than anywhere
    blur: float = 0.2
    noise: float = 0.2
    grey: float = 0.12
    shadow: float = 0.45
    relight: float = 0.4
    erase: float = 0.15
    white: float = 0.1  # the lamps' colour: each channel is multiplied by up to 1 + this or divided by it
    hue: float = 8.0  # degrees of cv2's 180
    saturation: float = 0.6
    brightness: float = 0.45


LIGHT = Recipe(
    mosaic=0.4, mix=0.0, paste=0.5, blur=0.12, noise=0.12, grey=0.05, shadow=0.3, relight=0.15, erase=0.0, hue=6.0, saturation=0.5,
    brightness=0.35, white=0.06,
)
"""Fewer changes: learnt several times faster, where there is no time for hundreds of epochs."""

FRAMES = Recipe(
    mosaic=0.2, mix=0.05, paste=0.6, scale_spread=1.4, focus=0.4, relight=0.25, shadow=0.35, erase=0.05, hue=6.0, saturation=0.5,
    brightness=0.35,
)
"""Views of a whole frame's size, less changed: large patches of broken road are seen uncut."""

SETTLING = Recipe(
    mosaic=0.0, mix=0.0, paste=0.5, mirror=0.5, scale_spread=1.2, aspect_spread=1.05, far=0.1, focus=0.0, blur=0.1, noise=0.1,
    grey=0.05, shadow=0.35, relight=0.2, erase=0.0, hue=5.0, saturation=0.4, brightness=0.3, white=0.05,
)
"""The last epochs: nearly what the network will see in a vehicle."""

GROUP_SHARES = {
    "survey_potholes": 0.41, "survey_empty": 0.14, "closeups": 0.03, "cones": 0.11, "simulated": 0.31, "own": 0.25, "set": 0.75,
    "composed": 0.17,
}
"""How often each kind of group is drawn, relative to the others there are. Groups of one kind (set:NAME, own:NUMBER) share by weight."""

GROUP_SCALES = {"closeups": 0.35, "cones": 0.8}
"""Typical scale of a group's pictures in a view, else 1: close-ups shrink to the size of potholes seen from a car."""

LETTERBOXED = ("own", "set", "composed")
"""Kinds of groups whose pictures have any size: a view shows them as large as the vehicle's input does."""

FARTHEST = 0.3
"""Photos of a set are mostly taken from near: some are shrunk, down to this."""

MIXED_MOSAICS = ("survey_potholes", "survey_empty", "closeups")
"""Groups that label the same. Any other group is alone in a mosaic, as the loss masks classes per image."""

ABSENT_WEIGHT = 0.3
"""How much background counts of a class that such pictures do not label but hardly ever show."""


def kind_of(group: str) -> str:
    """The kind of a group: set of set:accident_web."""
    return group.partition(":")[0]


def background_weight(group: str, class_name: str) -> float:
    """How much background of a class counts in pictures that do not label it, 0 to 1.

    Cone photos teach that kerbs and cars are no potholes, at a low weight as some do show a pothole; they
    show unlabelled road works too. Survey frames show unlabelled cones but hardly any of the other hazards.
    """
    if group == "cones":
        return ABSENT_WEIGHT if class_name in ("pothole", "deer", "stopped_accident") else 0.0
    if group.startswith("survey"):
        return 0.0 if class_name in ("pothole", "traffic_cone") else ABSENT_WEIGHT
    return 0.0


@dataclass
class Sample:
    """A finished training sample."""

    image: np.ndarray  # H x W x 3 uint8, RGB
    boxes: np.ndarray  # G x 4 corners
    classes: np.ndarray  # G
    ignored: np.ndarray  # K x 4 corners
    labelled: np.ndarray  # C: how much background of the class counts, 1 where every object is labelled


def move_boxes(boxes: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """N x 4 corners by a 2 x 3 transform without rotation."""
    if not len(boxes):
        return boxes
    xs = boxes[:, 0::2] * transform[0, 0] + transform[0, 2]
    ys = boxes[:, 1::2] * transform[1, 1] + transform[1, 2]
    return np.stack([xs.min(1), ys.min(1), xs.max(1), ys.max(1)], axis=1)


def ratio(rng: np.random.Generator, spread: float) -> float:
    """A random factor between 1 / spread and spread, uniform in its logarithm."""
    return float(np.exp(rng.uniform(-1, 1) * np.log(spread)))


def group_shares(
    weights: Dict[str, float], simulated_share: float, shares_of_kinds: Dict[str, float] = GROUP_SHARES
) -> Dict[str, float]:
    """How often each group is drawn, from the sums of its pictures' weights. They add up to 1."""
    kinds = {kind_of(name) for name in weights}
    simulated_share = simulated_share if "simulated" in kinds else 0.0
    real = sum(shares_of_kinds[kind] for kind in sorted(kinds) if kind != "simulated")
    of_kind = {kind: simulated_share if kind == "simulated" else shares_of_kinds[kind] * (1.0 - simulated_share) / real for kind in kinds}
    sums = {kind: sum(weight for name, weight in weights.items() if kind_of(name) == kind) for kind in kinds}
    return {name: of_kind[kind_of(name)] * weight / sums[kind_of(name)] for name, weight in weights.items()}


class Augmenter:
    """Draws samples of one size from groups of pictures."""

    def __init__(
        self, groups: Dict[str, List[Picture]], recipe: Recipe, width: int, height: int,
        simulated_share: float = GROUP_SHARES["simulated"], classes: Sequence[str] = CLASSES, pasted: Optional[sets.Pasted] = None,
        letterbox: Tuple[int, int] = (inference.INPUT_WIDTH, inference.INPUT_HEIGHT), shares_of_kinds: Dict[str, float] = GROUP_SHARES,
    ):
        self.letterbox = letterbox  # width and height of the input that shows a picture of any size
        self.pasted = pasted  # what is put into the pictures of the group "composed"
        self.groups, self.recipe, self.class_count = groups, recipe, len(classes)
        self.width, self.height = width, height
        self.names = sorted((name for name in groups if groups[name]), key=lambda name: list(GROUP_SHARES).index(kind_of(name)))
        weights = {name: np.array([picture.weight for picture in groups[name]]) for name in self.names}
        self.shares = group_shares({name: float(weight.sum()) for name, weight in weights.items()}, simulated_share, shares_of_kinds)
        self.picture_shares = {name: weight / weight.sum() for name, weight in weights.items()}
        self.backgrounds = {
            name: np.array([background_weight(name, class_name) for class_name in classes], np.float32) for name in self.names
        }

    def scale_of(self, rng: np.random.Generator, kind: str, picture: Picture) -> float:
        """How large a view shows a picture, before the recipe's spread."""
        scale = GROUP_SCALES.get(kind, 1.0)
        if kind in LETTERBOXED:
            scale *= inference.letterbox_scale(*picture.image.shape[1::-1], *self.letterbox)
        if kind == "set" and rng.random() < self.recipe.far:
            scale *= rng.uniform(FARTHEST, 1.0)
        return scale

    def draw(self, rng: np.random.Generator) -> Sample:
        """One sample: a view or a mosaic of views, then colour, noise and blur."""
        if rng.random() < self.recipe.mosaic:
            sample = self.mosaic(rng)
        else:
            sample = self.view(rng, self.width, self.height)
        if rng.random() < self.recipe.mix:
            self.mix_in(rng, sample)
        if rng.random() < self.recipe.erase:
            erase_patches(rng, sample)
        if rng.random() < self.recipe.shadow:
            cast_shadows(rng, sample.image)
        if rng.random() < self.recipe.relight:
            relight(rng, sample.image)
        sample.image = self.recolour(rng, sample.image)
        return sample

    def draw_group(self, rng: np.random.Generator, names: List[str]) -> str:
        """One of `names`, by their shares."""
        shares = np.array([self.shares[name] for name in names])
        return names[rng.choice(len(names), p=shares / shares.sum())]

    def mosaic(self, rng: np.random.Generator) -> Sample:
        """Four views around a random corner (YOLOv4). A class is background only in tiles that label it."""
        corner_x = int(self.width * rng.uniform(0.3, 0.7))
        corner_y = int(self.height * rng.uniform(0.3, 0.7))
        tiles = [
            (x, y, width, height)
            for y, height in ((0, corner_y), (corner_y, self.height - corner_y))
            for x, width in ((0, corner_x), (corner_x, self.width - corner_x))
        ]
        canvas = np.empty((self.height, self.width, 3), np.uint8)
        name = self.draw_group(rng, self.names)
        names = [other for other in self.names if other in MIXED_MOSAICS] if name in MIXED_MOSAICS else [name]
        views = []
        for x, y, width, height in tiles:
            view = self.view(rng, width, height, names)
            canvas[y : y + height, x : x + width] = view.image
            offset = np.array([x, y, x, y], np.float32)
            view.boxes, view.ignored = view.boxes + offset, view.ignored + offset
            views.append(view)
        return Sample(
            canvas,
            np.concatenate([view.boxes for view in views]),
            np.concatenate([view.classes for view in views]),
            np.concatenate([view.ignored for view in views]),
            np.min([view.labelled for view in views], axis=0),
        )

    def mix_in(self, rng: np.random.Generator, sample: Sample) -> None:
        """Shine another view faintly through (mixup, Zhang et al. 2018), in place; its labels are ignored."""
        other = self.view(rng, self.width, self.height)
        share = rng.uniform(0.1, 0.4)
        sample.image = cv2.addWeighted(sample.image, 1 - share, other.image, share, 0)
        sample.ignored = np.concatenate([sample.ignored, other.ignored, other.boxes]).astype(np.float32)

    def view(self, rng: np.random.Generator, width: int, height: int, names: List[str] = ()) -> Sample:
        """A scaled, shifted, perhaps mirrored window of one random picture."""
        name = self.draw_group(rng, list(names) or self.names)
        picture = self.groups[name][rng.choice(len(self.groups[name]), p=self.picture_shares[name])]
        if name.startswith("survey") and rng.random() < self.recipe.paste:
            picture = self.paste_potholes(rng, picture)
        kind = kind_of(name)
        if kind == "composed":
            picture = self.pasted.into(rng, picture)
        scale_y = self.scale_of(rng, kind, picture) * ratio(rng, self.recipe.scale_spread)
        scale_x = scale_y * ratio(rng, self.recipe.aspect_spread)
        left, top = self.place_window(rng, picture, width / scale_x, height / scale_y)
        transform = np.array([[scale_x, 0, -left * scale_x], [0, scale_y, -top * scale_y]])
        if rng.random() < self.recipe.mirror:
            transform[0] = [-scale_x, 0, width + left * scale_x]
        small = kind in LETTERBOXED
        sample = self.render(picture, transform, width, height, *((SMALL_SIZE_PX, SMALL_AREA_PX) if small else (MIN_SIZE_PX, MIN_AREA_PX)))
        sample.labelled = self.backgrounds[name].copy()
        sample.labelled[list(picture.absent_classes)] = ABSENT_WEIGHT
        sample.labelled[list(picture.labelled_classes)] = 1
        return sample

    def place_window(
        self, rng: np.random.Generator, picture: Picture, width: float, height: float
    ) -> Tuple[float, float]:
        """Left and top of a window, in pixels of the picture: around a label, or anywhere inside."""
        image_height, image_width = picture.image.shape[:2]
        spare = np.array([image_width - width, image_height - height])
        origin = rng.uniform(0, 1, 2) * spare
        if len(picture.boxes) and rng.random() < self.recipe.focus:
            box = picture.boxes[rng.integers(len(picture.boxes))]
            centre = (box[:2] + box[2:]) / 2
            origin = centre - rng.uniform(0.15, 0.85, 2) * [width, height]
            margin = 0.1 * np.array([width, height])
            origin = np.clip(origin, np.minimum(-margin, spare), np.maximum(spare + margin, 0))
        return float(origin[0]), float(origin[1])

    def render(
        self, picture: Picture, transform: np.ndarray, width: int, height: int,
        min_size: Tuple[float, float] = MIN_SIZE_PX, min_area: float = MIN_AREA_PX,
    ) -> Sample:
        """Warp a picture and its labels by a 2 x 3 transform without rotation."""
        image, shrink = picture.image, abs(transform[0, 0])
        warp = transform.copy()
        if shrink < 0.6:  # linear interpolation would skip pixels
            factor = max(shrink, 0.1)
            image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            warp[:, :2] /= [[image.shape[1] / picture.image.shape[1], image.shape[0] / picture.image.shape[0]]]
        image = cv2.warpAffine(
            image, warp, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT,
            borderValue=(PAD_VALUE,) * 3,
        )
        moved = move_boxes(picture.boxes, transform)
        difficult = box_math.clip_to_image(move_boxes(picture.difficult, transform), width, height)
        clipped = box_math.clip_to_image(moved, width, height)
        sizes = clipped[:, 2:] - clipped[:, :2]
        areas = box_math.areas(clipped)
        whole = (areas > MIN_VISIBLE_FRACTION * box_math.areas(moved)) & (areas > min_area)
        clear = whole & (sizes > min_size).all(1)
        return Sample(
            image,
            clipped[clear].astype(np.float32),
            picture.classes[clear],
            np.vstack([clipped[~clear & (areas > 0)], difficult[box_math.areas(difficult) > 0]]).astype(np.float32),
            np.zeros(self.class_count, np.float32),
        )

    def paste_potholes(self, rng: np.random.Generator, picture: Picture) -> Picture:
        """Up to three potholes of other pictures, blended into a survey frame."""
        image, boxes, classes = picture.image.copy(), picture.boxes, picture.classes
        for _ in range(rng.integers(1, 4)):
            donor, box = self.draw_donor(rng)
            pasted = blend_patch(rng, image, donor, box, boxes)
            if pasted is not None:
                boxes, classes = np.vstack([boxes, pasted]).astype(np.float32), np.append(classes, POTHOLE)
        return replace(picture, image=image, boxes=boxes, classes=classes)

    def draw_donor(self, rng: np.random.Generator) -> Tuple[np.ndarray, np.ndarray]:
        """A picture with a pothole of a size as in survey frames, and its box."""
        from_closeup = bool(self.groups.get("closeups")) and rng.random() < CLOSEUPS_AMONG_PASTED
        name = "closeups" if from_closeup else "survey_potholes"
        picture = self.groups[name][rng.choice(len(self.groups[name]), p=self.picture_shares[name])]
        box = picture.boxes[rng.integers(len(picture.boxes))] if len(picture.boxes) else np.zeros(4)
        if not from_closeup or (box[2:] - box[:2]).min() < 8:
            return picture.image, box
        # From a car the same hole is smaller and seen at a flatter angle.
        width = np.exp(rng.uniform(np.log(24), np.log(90)))
        factors = width / (box[2] - box[0]) * np.array([1.0, rng.uniform(0.4, 0.85)])
        image = cv2.resize(picture.image, None, fx=factors[0], fy=factors[1], interpolation=cv2.INTER_AREA)
        return image, box * np.tile([image.shape[1] / picture.image.shape[1], image.shape[0] / picture.image.shape[0]], 2)

    def recolour(self, rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
        """Hue, saturation, brightness, gamma and white balance; sometimes grey, blurred or noisy."""
        recipe = self.recipe
        levels = np.arange(256, dtype=np.float32)
        gain = 1 + recipe.brightness * rng.uniform(-1, 1)
        gamma = ratio(rng, 1 + recipe.brightness)
        value_table = (255 * (levels / 255) ** gamma * gain).clip(0, 255).astype(np.uint8)
        saturation_table = (levels * (1 + recipe.saturation * rng.uniform(-1, 1))).clip(0, 255).astype(np.uint8)
        hue_table = ((levels + recipe.hue * rng.uniform(-1, 1)) % 180).astype(np.uint8)
        hue, saturation, value = cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
        if rng.random() < recipe.grey:
            saturation[:] = 0
        image = cv2.cvtColor(
            cv2.merge([cv2.LUT(hue, hue_table), cv2.LUT(saturation, saturation_table), cv2.LUT(value, value_table)]),
            cv2.COLOR_HSV2RGB,
        )
        gains = np.array([ratio(rng, 1 + recipe.white) for _ in range(3)], np.float32)
        image = cv2.LUT(image, (levels[None, :, None] * gains).clip(0, 255).astype(np.uint8))
        if rng.random() < recipe.blur:
            image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.5, 1.3))
        if rng.random() < recipe.noise:
            noise = rng.normal(0, rng.uniform(2, 8), image.shape[:2] + (1,)).astype(np.float32)
            image = (image + noise).clip(0, 255).astype(np.uint8)
        return image


def cast_shadows(rng: np.random.Generator, image: np.ndarray) -> None:
    """Darken soft blobs of random size, as trees over a sunny road do, in place; flatter than high."""
    height, width = image.shape[:2]
    cells = rng.uniform(4, 14)
    noise = rng.normal(size=(int(cells * rng.uniform(1.0, 2.5)) + 2, int(cells) + 2)).astype(np.float32)
    field = cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    cover, edge = rng.uniform(-0.3, 1.0), rng.uniform(4, 12)
    shade = 1 / (1 + np.exp(-edge * (field - cover)))
    darkness = rng.uniform(0.35, 0.7)
    tint = np.array([1.06, 1.0, 0.92], np.float32) * darkness  # shade lacks the sun's red: blue is darkened less
    image[:] = (image * (1 - shade[..., None] * tint)).clip(0, 255).astype(np.uint8)


def relight(rng: np.random.Generator, image: np.ndarray) -> None:
    """A smooth ramp of brightness over the picture and a haze that takes contrast away, in place."""
    height, width = image.shape[:2]
    corners = rng.uniform(0.6, 1.3, (2, 2)).astype(np.float32)
    ramp = cv2.resize(corners, (width, height), interpolation=cv2.INTER_LINEAR)[..., None]
    haze, grey = rng.uniform(0, 0.35), rng.uniform(60, 220)
    image[:] = ((image * ramp) * (1 - haze) + haze * grey).clip(0, 255).astype(np.uint8)


def erase_patches(rng: np.random.Generator, sample: Sample) -> None:
    """Cover a few rectangles with noise (random erasing, Zhong et al. 2020), never much of a label, in place."""
    height, width = sample.image.shape[:2]
    for _ in range(rng.integers(1, 4)):
        size = rng.integers(12, 90, 2)
        left, top = rng.integers(0, width - size[0]), rng.integers(0, height - size[1])
        patch = np.array([[left, top, left + size[0], top + size[1]]], np.float32)
        cut = np.minimum(sample.boxes[:, 2:], patch[:, 2:]) - np.maximum(sample.boxes[:, :2], patch[:, :2])
        covered = cut.clip(min=0).prod(axis=1) / np.maximum(box_math.areas(sample.boxes), 1)
        if len(covered) and covered.max() > 0.3:
            continue
        grey = rng.normal(rng.uniform(40, 200), 12, (size[1], size[0], 3))
        sample.image[top : top + size[1], left : left + size[0]] = grey.clip(0, 255).astype(np.uint8)


def blend_patch(
    rng: np.random.Generator, image: np.ndarray, donor: np.ndarray, box: np.ndarray, taken: np.ndarray
) -> np.ndarray:
    """Carry the patch around `box` of `donor` into `image` (changed in place).

    What is carried is the patch's brightness relative to its rim, faded out towards the rim: the new
    surroundings keep their own colour. Returns the new box (1 x 4), or None where there is no free place.
    """
    size = box[2:] - box[:2]
    if size.min() < 6 or size.max() > 160:
        return None
    margin = np.maximum(4, 0.25 * size)
    height, width = image.shape[:2]
    x1, y1 = np.floor(box[:2] - margin).astype(int)
    x2, y2 = np.ceil(box[2:] + margin).astype(int)
    if x1 < 0 or y1 < 0 or x2 > donor.shape[1] or y2 > donor.shape[0]:
        return None
    patch = donor[y1:y2, x1:x2].astype(np.float32) + 1
    local_box = box - [x1, y1, x1, y1]
    if rng.random() < 0.5:
        patch = patch[:, ::-1]
        local_box[[0, 2]] = patch.shape[1] - local_box[[2, 0]]
    x = int(rng.uniform(0.25, 0.85) * width - patch.shape[1] / 2)
    # At about the row it came from, in a picture of the same height: that keeps the perspective.
    row = y1 if donor.shape[0] == height else rng.uniform(0.1, 0.9) * (height - patch.shape[0])
    y = int(np.clip(row + rng.uniform(-30, 30), 0, max(height - patch.shape[0], 0)))
    new_box = (local_box + [x, y, x, y])[None]
    if x < 0 or x + patch.shape[1] > width or patch.shape[0] > height or (len(taken) and box_math.pairwise_iou(new_box, taken).max() > 0):
        return None
    place = image[y : y + patch.shape[0], x : x + patch.shape[1]]
    if place.std(axis=(0, 1)).max() > MOST_CONTRAST_UNDER_PASTE:
        return None
    rim = np.concatenate([patch[0], patch[-1], patch[:, 0], patch[:, -1]]).mean(axis=0)
    mask = np.zeros(patch.shape[:2], np.float32)
    left, top, right, bottom = np.round(local_box).astype(int)
    mask[top:bottom, left:right] = 1
    mask = cv2.GaussianBlur(mask, (0, 0), float(margin.min()) / 2.5)[..., None]
    place[:] = (place * (1 + mask * (patch / rim - 1))).clip(0, 255).astype(np.uint8)
    return new_box
