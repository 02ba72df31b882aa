#!/usr/bin/python3
"""What the small vehicle's sending costs and keeps: uplink and event recall beside a detector on board.

    training/evaluate_discard.py --data ../shared/data --sections 386RS169832

Drives the validation sections at a constant speed and does to their frames what early_discard does (rate, threshold,
spacing, budget of bytes, JPEG), then runs the detector on what was sent, and on all frames as they are. A model of the
nodelets, with their defaults (config/early_discard.yaml), for figures without a running system.
"""

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import cv2
import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from common.figures import NothingMeasured, share, text
from detector.data import POTHOLE, VALIDATION_SECTIONS, DataError, DriveFrame, read_drive, read_yolo_labels
from detector.int8_model import forward_of
from detector.manifest import Manifest, ManifestError, read_manifest, sha256_of
from detector.metrics import NEAR_M, ScoredFrame, drive_figures
from detector.validation import DetectorRunner
from export_discard import Scorer

CONFIG = Path(__file__).parents[1] / "config" / "early_discard.yaml"
QUALITY_STEP, LOWEST_QUALITY = 20, 30  # Of src/hazard/picture.cpp.


@dataclass
class Sender:
    """The nodelet's decisions for the frames of one drive."""

    settings: dict
    threshold: float
    due_s: float = -np.inf
    last_sent_m: float = -np.inf
    budget: float = 0.0
    refilled_s: float = 0.0
    judged: int = 0
    candidates: int = 0
    sent_bytes: List[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.budget = self.settings["max_bytes_per_s"] * self.settings["burst_s"]

    def takes(self, time_s: float) -> bool:
        """Whether the classifier sees the frame of this moment."""
        if time_s < self.due_s:
            return False
        period_s = 1 / self.settings["rate_hz"]
        self.due_s = (self.due_s if time_s - self.due_s < period_s else time_s) + period_s
        self.judged += 1
        return True

    def send(self, image: np.ndarray, score: float, time_s: float, at_m: float) -> Optional[bytes]:
        """The file that leaves the car; none when nothing does."""
        if score < self.threshold:
            return None
        self.candidates += 1
        if at_m - self.last_sent_m < self.settings["min_spacing_m"]:
            return None
        full = self.settings["max_bytes_per_s"] * self.settings["burst_s"]
        self.budget = min(full, self.budget + (time_s - self.refilled_s) * self.settings["max_bytes_per_s"])
        self.refilled_s = time_s
        if self.budget < self.settings["min_image_bytes"]:
            return None
        file = encode(image, self.settings["jpeg_quality"], min(self.budget, self.settings["max_image_bytes"]))
        self.budget -= len(file)
        self.last_sent_m = at_m
        self.sent_bytes.append(len(file))
        return file


def encode(image: np.ndarray, quality: int, most: float) -> bytes:
    """As EncodeJpeg (src/hazard/picture.cpp), of an RGB image."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    while True:
        tried = quality
        while True:
            file = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, tried])[1].tobytes()
            if len(file) <= most:
                return file
            if tried <= LOWEST_QUALITY:
                break
            tried = max(LOWEST_QUALITY, tried - QUALITY_STEP)
        bgr = cv2.resize(bgr, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def read_classifier(manifest: Path) -> Tuple[Scorer, float]:
    """The classifier and its threshold."""
    try:
        content = yaml.safe_load(manifest.read_text())
        weights, threshold = manifest.parent / content["file"], float(content["thresholds"]["hazard"])
        same = sha256_of(weights) == content["sha256"]
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise ManifestError(f"Cannot read the manifest {manifest}: {error!r}.") from error
    if not same:
        raise ManifestError(f"{manifest}: the SHA-256 of {weights} is not the manifest's.")
    return Scorer(weights), threshold


class Drives:
    """Both profiles over the drives, and what they saw and sent; between them what a classifier could reach that sends all it sees."""

    def __init__(self, detector: Manifest, classify: Scorer, threshold: float, settings: dict, speed_mps: float):
        self.runner = DetectorRunner(forward_of(detector), detector.view)
        self.classify, self.threshold = classify, threshold
        self.settings, self.speed_mps = settings, speed_mps
        self.big: Dict[str, List[ScoredFrame]] = {}
        self.small: Dict[str, List[ScoredFrame]] = {}
        self.looked_at: Dict[str, List[ScoredFrame]] = {}
        self.seconds, self.bytes, self.judged, self.candidates, self.sent = 0.0, 0, 0, 0, 0

    def potholes(self, picture) -> np.ndarray:
        """Detections (M x 5) in a picture."""
        return self.runner.detect(picture.image)[POTHOLE]

    def drive(self, name: str, frames: List[DriveFrame]) -> None:
        """One drive; stretches without pictures are cut to NEAR_M, as replays cut them."""
        sender = Sender(self.settings, self.threshold)
        at_m, last_m = 0.0, frames[0].chainage_m
        big, looked_at, small = [], [], []
        for frame in frames:
            at_m += min(frame.chainage_m - last_m, NEAR_M)
            last_m = frame.chainage_m
            picture, time_s = frame.picture, at_m / self.speed_mps
            nothing, found = np.zeros((0, 5)), self.potholes(picture)
            file, is_looked_at = None, sender.takes(time_s)
            if is_looked_at:
                file = sender.send(picture.image, self.classify(picture.image), time_s, at_m)
            arrived = nothing if file is None else self.potholes_of_file(file, picture)
            for frames_of, detections in ((big, found), (looked_at, found if is_looked_at else nothing), (small, arrived)):
                frames_of.append(ScoredFrame(picture.boxes, detections, frame.chainage_m, difficult=picture.difficult))
        self.big[name], self.looked_at[name], self.small[name] = big, looked_at, small
        self.seconds += at_m / self.speed_mps
        self.judged, self.candidates = self.judged + sender.judged, self.candidates + sender.candidates
        self.sent, self.bytes = self.sent + len(sender.sent_bytes), self.bytes + sum(sender.sent_bytes)

    def potholes_of_file(self, file: bytes, picture) -> np.ndarray:
        """Detections in what arrives at the zone, in pixels of the picture before it was sent."""
        bgr = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR)
        arrived = type(picture)(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), picture.boxes, picture.classes, picture.labelled_classes)
        found = self.potholes(arrived)
        found[:, :4] *= picture.image.shape[1] / bgr.shape[1]
        return found


def read_section(data: Path, labels: str, name: str) -> List[DriveFrame]:
    """A survey section with the labels of the folder `labels` below `data`."""
    frames = read_drive(data / "road_survey" / name)
    if labels != "road_survey":
        for picture in (frame.picture for frame in frames):
            height, width = picture.image.shape[:2]
            files = [data / labels / name / kind / f"{picture.name}.txt" for kind in ("labels", "difficult")]
            picture.boxes = read_yolo_labels(files[0], width, height, [POTHOLE])[0]
            if files[1].exists():  # as a picture's own are read
                picture.difficult = read_yolo_labels(files[1], width, height, [POTHOLE])[0]
    return frames


def run(options: argparse.Namespace) -> None:
    """Measure and print."""
    manifest = read_manifest(options.detector)
    classify, threshold = read_classifier(options.manifest)
    settings = yaml.safe_load(CONFIG.read_text())
    settings["rate_hz"] = options.rate_hz or settings["rate_hz"]
    drives = Drives(manifest, classify, threshold, settings, options.speed_mps)
    for name in options.sections:
        drives.drive(name, read_section(options.data, options.labels, name))
    frames = sum(len(drive) for drive in drives.big.values())
    print(f"{frames} frames, {drives.seconds:.0f} s at {options.speed_mps} m/s, threshold {threshold}")
    print(f"judged {drives.judged}, candidates {drives.candidates}, sent {drives.sent}, {text(share(drives.bytes / 1000, drives.sent), 1)} kB each")
    print(f"uplink {text(share(8e-6 * drives.bytes, drives.seconds))} Mbit/s")
    for name, seen in (("detector on board", drives.big), ("frames looked at", drives.looked_at), ("small vehicle", drives.small)):
        found = drive_figures(seen, manifest.thresholds["pothole"])
        print(
            f"{name}: event recall {text(found.event_recall)} (IoU 0.3: {text(found.event_recall_iou30)}) of {found.event_count}, "
            f"false reports {text(found.false_reports_per_km, 1)} per km on {found.km:.2f} km"
        )
        if not found.event_count and not found.km:
            raise NothingMeasured("the sections have no event and no length.")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 measured, 1 there was nothing to measure, 2 the command line, a model or the data is wrong."""
    parser = argparse.ArgumentParser(description="Uplink and event recall of the small vehicle.")
    parser.add_argument("--manifest", type=Path, default=Path("models/early-discard.yaml"), help="the classifier")
    parser.add_argument("--detector", type=Path, default=Path("models/hazards-base.yaml"), help="the zone's")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets")
    parser.add_argument("--sections", nargs="+", default=list(VALIDATION_SECTIONS), help="of the road survey")
    parser.add_argument("--labels", default="road_survey", help="folder of the labels below --data: road_survey_second_labels for the second ones")
    parser.add_argument("--rate-hz", type=float, help="frames per second that the classifier looks at, else config/early_discard.yaml's")
    parser.add_argument("--speed-mps", type=float, default=16.0)
    parser.add_argument("--threads", type=int, default=1, help="threads of OpenCV")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(options.threads)
    try:
        run(options)
    except NothingMeasured as error:
        print(f"evaluate_discard: nothing was measured: {error}", file=sys.stderr)
        return 1
    except (ManifestError, DataError) as error:
        print(f"evaluate_discard: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
