"""Cut-out objects and putting them into photos, standing on the road at the size that the perspective asks for."""

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple

import cv2
import numpy as np

CONE = ((0.5, 0.0), (0.0, 1.0), (1.0, 1.0))
"""Where a cone is in its box."""

BLOCK = ((0.1, 0.1), (0.9, 0.1), (0.95, 0.95), (0.05, 0.95))
"""Where anything else is in its box, roughly."""


@dataclass
class CutOut:
    """An object without what was around it."""

    rgba: np.ndarray  # H x W x 4 uint8
    class_id: int


@dataclass(frozen=True)
class Ground:
    """How large things are at which row of a photo: the horizon's row, and the camera's height above the road."""

    horizon_px: float
    camera_m: float

    def height_px(self, object_m: float, row: float) -> float:
        """Of an upright object whose foot is at that row."""
        return object_m / self.camera_m * (row - self.horizon_px)


def cut_box(image: np.ndarray, box: np.ndarray, outline: Sequence[Tuple[float, float]], shares: Tuple[float, float] = (0.25, 0.85)) -> np.ndarray:
    """An object of a photo (box: corners in pixels) as RGBA, its outline found by GrabCut; empty where that fails.

    `outline` are the corners, in fractions of the box, of where the object probably is. It fails where the object fills
    less or more of the box than `shares` say.
    """
    height, width = image.shape[:2]
    margin = 0.25 * (box[2:] - box[:2])
    left, top = np.maximum(np.floor(box[:2] - margin), 0).astype(int)
    right, bottom = np.minimum(np.ceil(box[2:] + margin), [width, height]).astype(int)
    window = np.ascontiguousarray(image[top:bottom, left:right])
    inner = np.round(box - [left, top, left, top]).astype(int)
    labels = np.full(window.shape[:2], cv2.GC_BGD, np.uint8)
    labels[inner[1] : inner[3], inner[0] : inner[2]] = cv2.GC_PR_BGD
    corners = inner[:2] + np.array(outline) * (inner[2:] - inner[:2])
    cv2.fillPoly(labels, [corners.astype(np.int32)], cv2.GC_PR_FGD)
    cv2.setRNGSeed(1)
    cv2.grabCut(window, labels, None, np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_MASK)
    alpha = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8) * 255
    part = (slice(inner[1], inner[3]), slice(inner[0], inner[2]))
    share = alpha[part].mean() / 255 if alpha[part].size else 0
    if not shares[0] < share < shares[1]:
        return np.zeros((0, 0, 4), np.uint8)
    return np.dstack([window[part], alpha[part]])


def paste(
    image: np.ndarray, instances: Optional[np.ndarray], cut_out: CutOut, instance: int, foot: Tuple[float, float], height_px: float,
    gain: float, mirrored: bool,
) -> None:
    """Put an object's lowest middle point at `foot` (x, row), in place; `instances`, if any, gets its number where it covers."""
    scale = height_px / cut_out.rgba.shape[0]
    size = max(round(cut_out.rgba.shape[1] * scale), 2), max(round(height_px), 2)
    patch = cv2.resize(cut_out.rgba, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    if mirrored:
        patch = patch[:, ::-1]
    left, top = round(foot[0] - size[0] / 2), round(foot[1] - size[1])
    x1, y1 = max(left, 0), max(top, 0)
    x2, y2 = min(left + size[0], image.shape[1]), min(top + size[1], image.shape[0])
    if x1 >= x2 or y1 >= y2:
        return
    patch = patch[y1 - top : y2 - top, x1 - left : x2 - left]
    alpha = patch[..., 3:].astype(np.float32) / 255
    place = image[y1:y2, x1:x2]
    place[:] = (place * (1 - alpha) + (patch[..., :3] * gain).clip(0, 255) * alpha).astype(np.uint8)
    if instances is not None:
        instances[y1:y2, x1:x2][alpha[..., 0] > 0.5] = instance


def cast_contact_shadow(image: np.ndarray, foot: Tuple[float, float], width_px: float, darkness: float) -> None:
    """A dark spot on the road under an object, in place: no part of it."""
    axes = (max(round(0.6 * width_px), 1), max(round(0.12 * width_px), 1))
    blur_px = max(0.08 * width_px, 0.6)
    margin = int(np.ceil(4 * blur_px)) + 1  # where the blur has nothing left: only what lies within is touched
    left, top = max(round(foot[0]) - axes[0] - margin, 0), max(round(foot[1]) - axes[1] - margin, 0)
    right, bottom = round(foot[0]) + axes[0] + margin, round(foot[1]) + axes[1] + margin
    place = image[top:bottom, left:right]
    if not place.size:
        return
    shade = np.zeros(place.shape[:2], np.float32)
    cv2.ellipse(shade, (round(foot[0]) - left, round(foot[1]) - top), axes, 0, 0, 360, darkness, -1)
    shade = cv2.GaussianBlur(shade, (0, 0), blur_px)
    place[:] = (place * (1 - shade[..., None])).astype(np.uint8)
