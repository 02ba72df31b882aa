"""From pairs, scenes and photos to training samples.

Everything random comes from one numpy generator that the caller seeds per sample, so a sample depends on
(seed, epoch, index) alone: not on workers, not on an interrupted run.
"""

from dataclasses import dataclass, field
from typing import Dict, List, Optional, Sequence, Tuple

import cv2
import numpy as np

from common.pasting import CutOut
from detector.augment import cast_shadows, ratio, relight

from .classes import NO_CHANGE
from .data import IGNORED, Pair, Scene
from .inference import PAD_VALUE, fill_invalid
from .paste import paste_pair
from .roads import Roads


@dataclass(frozen=True)
class Recipe:
    """How samples are made. Probabilities are per sample."""

    width: int = 224
    height: int = 192
    identical: float = 0.15  # one picture twice: nothing has changed
    roads: float = 0.6  # of the rest: street photos at full resolution, where there are such
    photos: float = 0.25  # of the rest: photos with pasted objects, where there are photos
    swap: float = 0.5
    mirror: float = 0.5
    focus: float = 0.7  # a view is placed around a changed pixel rather than anywhere
    scale: Tuple[float, float] = (0.75, 1.5)
    rotation_deg: float = 3.0
    misaligned_px: float = 2.0  # a corner of one picture is moved by up to so much, on top of the registration's error
    season: float = 0.7  # of the photometric and seasonal changes that each picture gets on its own


SETTLING = Recipe(width=320, height=256, focus=0.0, scale=(0.92, 1.15), rotation_deg=1.5, misaligned_px=1.0, season=0.4)
"""The last epochs: nearly what the network will see in a vehicle."""


@dataclass
class Source:
    """What samples are drawn from."""

    pairs: List[Pair]
    scenes: List[Scene] = field(default_factory=list)
    photos: Dict[str, List[np.ndarray]] = field(default_factory=dict)  # by group
    cut_outs: Dict[int, List[CutOut]] = field(default_factory=dict)  # by class
    roads: Optional[Roads] = None

    def __post_init__(self):
        self.registered = [pair for pair in self.pairs if pair.homographies()]


@dataclass
class Sample:
    """A finished training sample; pictures are H x W x 3 uint8, RGB."""

    first: np.ndarray
    second: np.ndarray
    mask: np.ndarray  # H x W uint8, into CLASSES, or IGNORED


def draw_view(rng: np.random.Generator, recipe: Recipe, mask: np.ndarray) -> np.ndarray:
    """3 x 3 from pixels of the second picture to those of the sample: scaled, turned, shifted, perhaps mirrored."""
    height, width = mask.shape
    scale = float(np.exp(rng.uniform(*np.log(recipe.scale))))
    changed = np.argwhere((mask != NO_CHANGE) & (mask != IGNORED)) if rng.random() < recipe.focus else []
    if len(changed):
        row, column = changed[rng.integers(len(changed))]
        centre = np.array([column, row]) - (rng.uniform(0.2, 0.8, 2) - 0.5) * [recipe.width, recipe.height] / scale
    else:
        spare = np.maximum([width - recipe.width / scale, height - recipe.height / scale], 0)
        centre = np.array([width, height]) / 2 + rng.uniform(-0.5, 0.5, 2) * spare
    # Views do not leave the picture further than a tenth of their size.
    reach = np.array([recipe.width, recipe.height]) / scale * 0.4
    centre = np.clip(centre, np.minimum(reach, [width / 2, height / 2]), np.maximum([width, height] - reach, [width / 2, height / 2]))
    angle = np.deg2rad(recipe.rotation_deg) * rng.uniform(-1, 1)
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    if rng.random() < recipe.mirror:
        turn[0] *= -1
    view = np.eye(3)
    view[:2, :2] = turn
    view[:2, 2] = np.array([recipe.width, recipe.height]) / 2 - turn @ centre
    return view


def draw_misalignment(rng: np.random.Generator, recipe: Recipe, width: int, height: int, share: float) -> np.ndarray:
    """3 x 3 near the identity: what a registration leaves."""
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    moved = corners + share * recipe.misaligned_px * rng.uniform(-1, 1, (4, 2)).astype(np.float32)
    return cv2.getPerspectiveTransform(corners, moved.astype(np.float32))


def warp(image: np.ndarray, transform: np.ndarray, recipe: Recipe, labels: Optional[int] = None) -> np.ndarray:
    """A picture through a homography; of labels (nearest neighbour) what is outside gets `labels`."""
    return cv2.warpPerspective(
        image, transform, (recipe.width, recipe.height), flags=cv2.INTER_LINEAR if labels is None else cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(PAD_VALUE,) * 3 if labels is None else labels,
    )


def recolour(rng: np.random.Generator, image: np.ndarray, strength: float) -> np.ndarray:
    """Brightness, gamma, contrast, saturation, hue, white balance; sometimes blurred or noisy."""
    levels = np.arange(256, dtype=np.float32)
    gain, gamma = ratio(rng, 1 + 0.5 * strength), ratio(rng, 1 + 0.6 * strength)
    value_table = (255 * (levels / 255) ** gamma * gain).clip(0, 255).astype(np.uint8)
    saturation_table = (levels * ratio(rng, 1 + strength)).clip(0, 255).astype(np.uint8)
    hue_table = ((levels + 8 * strength * rng.uniform(-1, 1)) % 180).astype(np.uint8)
    hue, saturation, value = cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
    changed = cv2.merge([cv2.LUT(hue, hue_table), cv2.LUT(saturation, saturation_table), cv2.LUT(value, value_table)])
    gains = np.array([ratio(rng, 1 + 0.2 * strength) for _ in range(3)], np.float32)
    image = cv2.LUT(cv2.cvtColor(changed, cv2.COLOR_HSV2RGB), (levels[None, :, None] * gains).clip(0, 255).astype(np.uint8))
    if rng.random() < 0.3 * strength:
        image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 1.1))
    if rng.random() < 0.4 * strength:
        noise = rng.normal(0, rng.uniform(2, 9), image.shape).astype(np.float32)
        image = (image + noise).clip(0, 255).astype(np.uint8)
    return image


def lay_snow(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """White on what lies flat and is plain: patches of the lower part, most where the picture has no edges."""
    height, width = image.shape[:2]
    patches = cv2.resize(rng.normal(size=(6, 8)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    cover = 1 / (1 + np.exp(-4 * (patches + rng.uniform(-0.5, 1.2))))
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    edges = cv2.GaussianBlur(np.abs(cv2.Laplacian(grey, cv2.CV_32F)), (0, 0), 1.5)
    below = np.clip((np.arange(height, dtype=np.float32) / height - rng.uniform(0.3, 0.6)) * 6, 0, 1)[:, None]
    share = (cover * np.exp(-edges / 12) * below * rng.uniform(0.5, 0.9))[..., None]
    white = np.array([228, 232, 240], np.float32) * rng.uniform(0.7, 1)
    return (image * (1 - share) + white * share).astype(np.uint8)


def fall_dusk(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """Darker and bluer."""
    tint = np.array([0.8, 0.9, 1.1], np.float32) * rng.uniform(0.3, 0.75)
    return (image * tint).clip(0, 255).astype(np.uint8)


def wet_road(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """The lower part darker, with a faint mirror image of what is above it."""
    height = image.shape[0]
    horizon = int(height * rng.uniform(0.4, 0.6))
    lower = image[horizon:].astype(np.float32) * rng.uniform(0.55, 0.85)
    above = image[max(2 * horizon - height, 0) : horizon][::-1]
    mirrored = cv2.GaussianBlur(above, (0, 0), 3)[: len(lower)].astype(np.float32)
    lower[: len(mirrored)] = 0.8 * lower[: len(mirrored)] + rng.uniform(0.1, 0.3) * mirrored
    wet = image.copy()
    wet[horizon:] = lower.clip(0, 255).astype(np.uint8)
    return wet


SEASONS = (lay_snow, fall_dusk, wet_road)


def change_season(rng: np.random.Generator, image: np.ndarray, strength: float) -> np.ndarray:
    """What another day, hour or season does to a picture and what is no change."""
    image = image.copy()
    if rng.random() < 0.3 * strength:
        image = SEASONS[rng.integers(len(SEASONS))](rng, image)
    if rng.random() < 0.2 * strength:
        cast_shadows(rng, image)
    if rng.random() < 0.25 * strength:
        relight(rng, image)
    return recolour(rng, image, strength)


class Augmenter:
    """Draws samples of one recipe."""

    def __init__(self, source: Source, recipe: Recipe):
        if not source.registered and not source.photos and source.roads is None:
            raise ValueError("there are neither registered pairs nor photos")
        self.source, self.recipe = source, recipe
        self.groups = sorted(source.photos)

    def draw(self, rng: np.random.Generator) -> Sample:
        """One sample: registered, seen through one view, each picture in a light of its own, perhaps in reverse order."""
        recipe = self.recipe
        first, second, mask, homography = self.draw_pair(rng)
        identical = rng.random() < recipe.identical
        if identical:
            first, homography, mask = second, np.eye(3), np.zeros_like(mask)
        height, width = mask.shape
        view = draw_view(rng, recipe, mask)
        misaligned = draw_misalignment(rng, recipe, width, height, 0.5 if identical else 1.0)
        onto = view @ misaligned @ homography
        validity = warp(np.ones(first.shape[:2], np.uint8), onto, recipe, 0)
        first, second = warp(first, onto, recipe), warp(second, view, recipe)
        truth = warp(mask, view, recipe, IGNORED)
        inside = warp(np.ones(mask.shape, np.uint8), view, recipe, 0)
        first, second = (change_season(rng, image, recipe.season) for image in (first, second))
        second = np.where(inside[..., None] > 0, second, PAD_VALUE).astype(np.uint8)
        validity = validity * inside
        first = fill_invalid(first, second, validity)
        truth[validity == 0] = IGNORED
        if rng.random() < recipe.swap:
            first, second = second, first
        return Sample(first, second, truth)

    def draw_pair(self, rng: np.random.Generator) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """First and second picture, mask, and the homography from the first to the second."""
        source = self.source
        if source.roads is not None and (not source.registered and not source.photos or rng.random() < self.recipe.roads):
            return (*source.roads.draw(rng), np.eye(3))
        from_photo = self.groups and (not source.registered or rng.random() < self.recipe.photos)
        if not from_photo:
            pair = source.registered[rng.integers(len(source.registered))]
            homographies = pair.homographies()
            return pair.first, pair.second, pair.mask, homographies[rng.integers(len(homographies))]
        group = self.groups[rng.integers(len(self.groups))]
        photo = source.photos[group][rng.integers(len(source.photos[group]))]
        return (*paste_pair(rng, photo, group, source.cut_outs), np.eye(3))


class SceneAugmenter:
    """Draws (picture, classes) for the encoder's pretraining, as samples whose second picture is the picture."""

    def __init__(self, scenes: Sequence[Scene], recipe: Recipe):
        if not scenes:
            raise ValueError("there are no scenes")
        self.scenes, self.recipe = scenes, recipe

    def draw(self, rng: np.random.Generator) -> Sample:
        """One sample; its first picture says nothing."""
        scene = self.scenes[rng.integers(len(self.scenes))]
        view = draw_view(rng, self.recipe, scene.classes)
        image = change_season(rng, warp(scene.image, view, self.recipe), self.recipe.season)
        return Sample(image, image, warp(scene.classes, view, self.recipe, IGNORED))
