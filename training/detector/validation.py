"""Running a network over the validation parts of the data."""

from dataclasses import dataclass
from typing import Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np
import torch

from common.figures import mean

from . import inference
from .data import POTHOLE, TRAFFIC_CONE, DriveFrame, Picture
from .metrics import DriveFigures, ScoredFrame, average_precision, calibrate_threshold, drive_figures

FALSE_REPORTS_PER_KM = 10.0
"""How many false reports the threshold may cost."""

ForwardFunction = Callable[[np.ndarray], Tuple[np.ndarray, np.ndarray]]
"""3 x H x W normalised input to raw boxes (N x 4) and scores (N x C)."""


def torch_forward(model: torch.nn.Module, device: torch.device, precision: str) -> ForwardFunction:
    """A runner of a network in evaluation mode."""

    @torch.no_grad()
    def run(image: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(image)[None].to(device).contiguous(memory_format=torch.channels_last)
        with torch.autocast(device.type, dtype=torch.bfloat16, enabled=precision == "bf16"):
            raw = model(batch)[0].float().cpu()
        return raw[:, :4].numpy(), raw[:, 4:].sigmoid().numpy()

    return run


class DetectorRunner:
    """A network that looks at whole pictures."""

    def __init__(self, run: ForwardFunction, view: inference.ViewConfig = inference.ViewConfig()):
        self.run, self.view = run, view
        self.grid = inference.AnchorGrid.of(view.width, view.height, view.scales)

    def views(self, pixels: np.ndarray) -> List[List[np.ndarray]]:
        """Detections (M x 5) per view and class of H x W x 3."""
        image, scale = inference.letterbox(pixels, self.view.width, self.view.height)
        return inference.decode_views(*self.run(inference.normalise(image)), self.grid, scale, pixels.shape[1::-1])

    def detect(self, pixels: np.ndarray) -> List[np.ndarray]:
        """Detections (M x 5) per class."""
        views = self.views(pixels)
        if self.view.mirrored:
            mirrored = self.views(np.ascontiguousarray(pixels[:, ::-1]))
            views += [[inference.mirrored_boxes(found, pixels.shape[1]) for found in view] for view in mirrored]
        return inference.fuse_views(views)


@dataclass
class Validation:
    """All frames of the validation parts with what was detected in them, per class."""

    potholes: Dict[str, List[ScoredFrame]]  # by drive
    cones: List[ScoredFrame]
    others_on_drives: Dict[int, Dict[str, List[ScoredFrame]]]  # by class and drive; drives label potholes only: nearly all are false

    def pothole_ap(self, iou: float) -> Optional[float]:
        """Average precision over the frames of all drives."""
        return average_precision([frame for drive in self.potholes.values() for frame in drive], iou)

    def cone_ap(self, iou: float) -> Optional[float]:
        """Average precision over the cone photos."""
        return average_precision(self.cones, iou)

    def best_drive_figures(self) -> DriveFigures:
        """Figures at the threshold that the limit on false reports allows."""
        return drive_figures(self.potholes, calibrate_threshold(self.potholes, FALSE_REPORTS_PER_KM))


def scored_frames(picture: Picture, found: List[np.ndarray], classes: Sequence[str]) -> Dict[str, ScoredFrame]:
    """Labels and what was found, of each class that the picture labels."""
    frames = {}
    for class_id in sorted(set(picture.labelled_classes)):
        labels, difficult = (boxes[ids == class_id] for boxes, ids in (
            (picture.boxes, picture.classes), (picture.difficult, picture.difficult_classes)))
        frames[classes[class_id]] = ScoredFrame(labels, found[class_id], difficult=difficult)
    return frames


def detect_labelled(runner: DetectorRunner, pictures: List[Picture], classes: Sequence[str]) -> Dict[str, List[ScoredFrame]]:
    """Detections and labels by class, in pictures that label it."""
    frames: Dict[str, List[ScoredFrame]] = {}
    for picture in pictures:
        for name, frame in scored_frames(picture, runner.detect(picture.image), classes).items():
            frames.setdefault(name, []).append(frame)
    return frames


@dataclass
class ClassFigure:
    """Average precision of one class over held-out pictures."""

    ap50: Optional[float]  # None without labels
    labels: int
    pictures: int


def class_figure(frames: List[ScoredFrame]) -> ClassFigure:
    """The figure of one class."""
    return ClassFigure(average_precision(frames, 0.5), sum(len(frame.labels) for frame in frames), len(frames))


@dataclass
class HeldOut:
    """Figures of the held-out parts of the sets, by class, and by class and set."""

    pooled: Dict[str, ClassFigure]
    by_set: Dict[str, Dict[str, ClassFigure]]


def validate_held_out(runner: DetectorRunner, parts: Dict[str, List[Picture]], classes: Sequence[str]) -> HeldOut:
    """Detect in the held-out part of every set; a picture counts for the classes that it labels."""
    frames: Dict[str, Dict[str, List[ScoredFrame]]] = {name: {} for name in classes}
    for part, pictures in parts.items():
        for name, of_class in detect_labelled(runner, pictures, classes).items():
            frames[name][part] = of_class
    pooled = {name: class_figure([frame for part in parts.values() for frame in part]) for name, parts in frames.items() if parts}
    return HeldOut(
        {name: figure for name, figure in pooled.items() if figure.labels},
        {name: {part: class_figure(of_part) for part, of_part in parts.items()} for name, parts in frames.items() if name in pooled},
    )


def selection_figure(held_out: HeldOut, pothole_ap: Optional[float], cone_ap: Optional[float]) -> float:
    """Which weights are best: the mean AP50 over classes.

    Potholes and cones count the mean of the pooled held-out parts and of the older validation part (survey sections,
    cone photos): neither chooses alone. Parts without labels do not count; 0 where none has any.
    """
    by_class: Dict[str, List[Optional[float]]] = {name: [figure.ap50] for name, figure in held_out.pooled.items()}
    by_class.setdefault("pothole", []).append(pothole_ap)
    by_class.setdefault("traffic_cone", []).append(cone_ap)
    return mean(mean(figures) for figures in by_class.values()) or 0.0


def validate(runner: DetectorRunner, drives: Dict[str, List[DriveFrame]], cones: List[Picture]) -> Validation:
    """Detect in every validation picture."""
    result = Validation({}, [], {})
    for name, drive in drives.items():
        found = [runner.detect(frame.picture.image) for frame in drive]
        result.potholes[name] = [
            ScoredFrame(frame.picture.boxes, detections[POTHOLE], frame.chainage_m)
            for frame, detections in zip(drive, found)
        ]
        for class_id in range(len(found[0]) if found else 0):
            result.others_on_drives.setdefault(class_id, {})[name] = [
                ScoredFrame(np.zeros((0, 4)), detections[class_id], frame.chainage_m) for frame, detections in zip(drive, found)
            ]
    result.cones = [
        ScoredFrame(picture.boxes, runner.detect(picture.image)[TRAFFIC_CONE]) for picture in cones
    ]
    return result
