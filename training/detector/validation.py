"""Running a network over the validation parts of the data."""

from dataclasses import dataclass
from typing import Callable, Dict, List, Tuple

import numpy as np
import torch

from . import CLASSES, inference
from .data import POTHOLE, TRAFFIC_CONE, DriveFrame, Picture
from .metrics import DriveFigures, ScoredFrame, average_precision, calibrate_threshold, drive_figures

FALSE_REPORTS_PER_KM = 9.0
"""How many false reports the threshold may cost. The goal is 10; a tenth is kept in reserve."""

Runner = Callable[[np.ndarray], Tuple[np.ndarray, np.ndarray]]
"""3 x H x W normalised input to raw boxes (N x 4) and scores (N x C)."""


def torch_runner(model: torch.nn.Module, device: torch.device, precision: str) -> Runner:
    """A runner of a network in evaluation mode."""

    @torch.no_grad()
    def run(image: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(image)[None].to(device).contiguous(memory_format=torch.channels_last)
        with torch.autocast(device.type, dtype=torch.bfloat16, enabled=precision == "bf16"):
            raw = model(batch)[0].float().cpu()
        return raw[:, :4].numpy(), raw[:, 4:].sigmoid().numpy()

    return run


def detect(picture: Picture, run: Runner, grid: inference.AnchorGrid, width: int, height: int) -> List[np.ndarray]:
    """Detections (M x 5) per class of one picture."""
    image, scale = inference.letterbox(picture.image, width, height)
    raw_boxes, scores = run(inference.normalise(image))
    size = (picture.image.shape[1], picture.image.shape[0])
    return inference.decode(raw_boxes, scores, grid, scale, size)


@dataclass
class Validation:
    """All frames of the validation parts with what was detected in them, per class."""

    potholes: Dict[str, List[ScoredFrame]]  # by drive
    cones: List[ScoredFrame]
    cones_on_drives: Dict[str, List[ScoredFrame]]  # drives do not label cones: nearly all of these are false

    def pothole_ap(self, iou: float) -> float:
        """Average precision over the frames of all drives."""
        return average_precision([frame for drive in self.potholes.values() for frame in drive], iou)

    def cone_ap(self, iou: float) -> float:
        """Average precision over the cone photos."""
        return average_precision(self.cones, iou)

    def best_drive_figures(self) -> DriveFigures:
        """Figures at the threshold that the limit on false reports allows."""
        return drive_figures(self.potholes, calibrate_threshold(self.potholes, FALSE_REPORTS_PER_KM))


def detect_simulated(
    run: Runner, pictures: List[Picture], size: Tuple[int, int] = inference.INPUT_SIZE, scales: Tuple[float, ...] = (1.0,)
) -> Dict[str, List[ScoredFrame]]:
    """Detections and labels in frames of simulated drives, by class; `size` is the network's input, width and height."""
    grid = inference.AnchorGrid.of(*size, scales)
    frames = {name: [] for name in CLASSES}
    for picture in pictures:
        found = detect(picture, run, grid, *size)
        for class_id, name in enumerate(CLASSES):
            labels, difficult = (boxes[classes == class_id] for boxes, classes in (
                (picture.boxes, picture.classes), (picture.difficult, picture.difficult_classes)))
            frames[name].append(ScoredFrame(labels, found[class_id], difficult=difficult))
    return frames


def validate(
    run: Runner, drives: Dict[str, List[DriveFrame]], cones: List[Picture],
    size: Tuple[int, int] = inference.INPUT_SIZE, scales: Tuple[float, ...] = (1.0,),
) -> Validation:
    """Detect in every validation picture; `size` is the network's input, width and height, `scales` those of its views."""
    grid = inference.AnchorGrid.of(*size, scales)
    result = Validation({}, [], {})
    for name, drive in drives.items():
        found = [detect(frame.picture, run, grid, *size) for frame in drive]
        result.potholes[name] = [
            ScoredFrame(frame.picture.boxes, detections[POTHOLE], frame.chainage_m)
            for frame, detections in zip(drive, found)
        ]
        result.cones_on_drives[name] = [
            ScoredFrame(np.zeros((0, 4)), detections[TRAFFIC_CONE], frame.chainage_m)
            for frame, detections in zip(drive, found)
        ]
    result.cones = [
        ScoredFrame(picture.boxes, detect(picture, run, grid, *size)[TRAFFIC_CONE]) for picture in cones
    ]
    return result
