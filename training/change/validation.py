"""Figures on held-out pairs, as the vehicle would see them: registered by features, the network's whole picture."""

from dataclasses import dataclass, field
from typing import Callable, Dict, List, Optional, Sequence, Tuple

import cv2
import numpy as np
import torch

from .augment import Source, change_season
from .data import IGNORED, Pair
from .inference import INPUT_HEIGHT, INPUT_WIDTH, PAD_VALUE, fill_invalid, letterbox, normalise
from .metrics import PixelCounts
from .network import Network
from .paste import paste_pair

FALSE_POSITIVE_RATES = (0.01, 0.10)

Detect = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""First and second picture (H x W x 3 uint8) and validity (H x W uint8) to probabilities (C x H x W)."""


@dataclass
class RegisteredPair:
    """Two pictures of the network's size, one warped onto the other, and the truth."""

    first: np.ndarray
    second: np.ndarray
    validity: np.ndarray  # H x W uint8: 1, or 0 where the warp had nothing
    mask: np.ndarray
    part: str = "changes"  # "changes", "unchanged" or "photos"


def torch_detector(network: Network, device: torch.device, precision: str) -> Detect:
    """A network as validation uses it; switches it to inference."""
    network.eval()

    @torch.no_grad()
    def detect(first: np.ndarray, second: np.ndarray, validity: np.ndarray) -> np.ndarray:
        pictures = [torch.from_numpy(normalise(image))[None].to(device) for image in (first, second)]
        valid = torch.from_numpy(validity.astype(np.float32))[None, None].to(device)
        with torch.autocast(device.type, dtype=torch.bfloat16, enabled=precision == "bf16"):
            return network.detect(*pictures, valid)[0].float().cpu().numpy()

    return detect


def aligned(pair: Pair) -> Tuple[np.ndarray, np.ndarray]:
    """The first picture in the second one's view, and where it is known (H x W uint8, 1 or 0): nowhere when the pair was refused.

    As in a vehicle, which warps before it adds the padding.
    """
    rows, columns = pair.content
    if pair.homography is None:
        validity, warped = np.zeros(pair.mask.shape, np.uint8), pair.second
    else:
        ones = np.zeros(pair.mask.shape, np.uint8)
        ones[:rows, :columns] = 1
        size = (INPUT_WIDTH, INPUT_HEIGHT)
        validity = cv2.warpPerspective(ones, pair.homography, size, flags=cv2.INTER_NEAREST)
        warped = cv2.warpPerspective(pair.first, pair.homography, size, borderValue=(PAD_VALUE,) * 3)
    filled = fill_invalid(warped, pair.second, validity)
    for padding in (np.s_[rows:], np.s_[:, columns:]):
        validity[padding], filled[padding] = 1, PAD_VALUE
    return filled, validity


def register(pair: Pair, part: str) -> RegisteredPair:
    """A pair as it is validated: what the warp could not fill is left out."""
    first, validity = aligned(pair)
    mask = np.where(validity > 0, pair.mask, IGNORED).astype(np.uint8)
    return RegisteredPair(first, pair.second, validity, mask, part)


def registered_pairs(pairs: Sequence[Pair]) -> List[RegisteredPair]:
    """What of a simulated validation folder counts; `none` holds pairs where nothing has changed, `all` is left out."""
    found = []
    for pair in pairs:
        if pair.homography is not None and not f"/{pair.name}".count("/all/"):
            found.append(register(pair, "unchanged" if f"/{pair.name}".count("/none/") else "changes"))
    return found


def photo_pairs(source: Source, count: int, seed: int) -> List[RegisteredPair]:
    """Pairs of photos with pasted objects, each picture in a light of its own."""
    groups, found = sorted(source.photos), []
    for index in range(count if source.cut_outs else 0):
        rng = np.random.default_rng([seed, index])
        group = groups[index % len(groups)]
        photo = source.photos[group][rng.integers(len(source.photos[group]))]
        first, second, mask = paste_pair(rng, photo, group, source.cut_outs)
        first, second = (letterbox(change_season(rng, image, 0.4)) for image in (first, second))
        scale = min(INPUT_WIDTH / mask.shape[1], INPUT_HEIGHT / mask.shape[0])
        size = round(mask.shape[1] * scale), round(mask.shape[0] * scale)
        fitted = np.full((INPUT_HEIGHT, INPUT_WIDTH), IGNORED, np.uint8)
        fitted[: size[1], : size[0]] = cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST)
        # One of them is moved by a pixel or so, as a registration leaves it.
        corners = np.float32([[0, 0], [INPUT_WIDTH, 0], [INPUT_WIDTH, INPUT_HEIGHT], [0, INPUT_HEIGHT]])
        moved = (corners + rng.uniform(-1.5, 1.5, (4, 2))).astype(np.float32)
        warp = cv2.getPerspectiveTransform(corners, moved)
        first = cv2.warpPerspective(first, warp, (INPUT_WIDTH, INPUT_HEIGHT), borderMode=cv2.BORDER_REPLICATE)
        found.append(RegisteredPair(first, second, np.ones_like(fitted), fitted, "photos"))
    return found


@dataclass
class Report:
    """Counts of every part of the validation."""

    counts: Dict[str, PixelCounts] = field(default_factory=dict)

    def of(self, part: str) -> PixelCounts:
        """The counts of one part, empty at first."""
        return self.counts.setdefault(part, PixelCounts())

    def figures(self) -> Dict[str, Optional[float]]:
        """The figures by name; a part without pairs has none, and None is what nothing was counted for."""
        figures: Dict[str, Optional[float]] = {}
        for part in ("changes", "reversed", "photos"):
            if part not in self.counts:
                continue
            best = self.counts[part].best_class_figures()
            for rate in FALSE_POSITIVE_RATES:
                figures[f"{part}_f1_at_{rate:.2f}"] = self.counts[part].at_false_positive_rate(rate)["f1"]
            figures[f"{part}_multi_class"] = best["multi_class"]
            figures[f"{part}_f1"] = best["f1"]
        if "changes" in self.counts:
            figures["changed_share"] = self.counts["changes"].best_class_figures()["changed_share"]
        for part in ("unchanged", "identical"):
            if part in self.counts:
                figures[f"{part}_fpr"] = self.counts[part].best_class_figures()["false_positive_rate"]
        return figures


def validate(detect: Detect, pairs: Sequence[RegisteredPair], seed: int = 1) -> Report:
    """All pairs; those with changes also in reverse order, and their second picture against itself in another light."""
    report = Report()
    for index, pair in enumerate(pairs):
        report.of(pair.part).add(detect(pair.first, pair.second, pair.validity), pair.mask)
        if pair.part != "changes":
            continue
        report.of("reversed").add(detect(pair.second, pair.first, pair.validity), pair.mask)
        relit = change_season(np.random.default_rng([seed, index]), pair.second, 0.7)
        unchanged = np.where(pair.mask == IGNORED, IGNORED, 0).astype(np.uint8)
        report.of("identical").add(detect(relit, pair.second, np.ones_like(pair.validity)), unchanged)
    return report
