#!/usr/bin/python3
"""Export the small vehicle's classifier as ONNX with its manifest and golden outputs, and print its figures.

    training/export_discard.py --data ../shared/data --sets training/real_hazards.yaml --out models \
        --training build/training/discard

The threshold is the lowest one of those that send 0.95 of the frames with a hazard on the survey sections kept for
calibration, 0.9 on the photos of the sets kept for it (--sets) and 0.95 on simulated drives (--simulated; seeds that
training has not seen). Figures are of the validation sections and of the sets' held-out parts, which chose nothing.
"""

import argparse
import sys
from pathlib import Path
from typing import Dict, List, Optional

import cv2
import numpy as np
import torch
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from detector import inference, sets
from detector.data import VALIDATION_SECTIONS, DataError, DriveFrame
from detector.manifest import sha256_of
from detector.onnx_model import golden_image
from early_discard import INPUT_HEIGHT, INPUT_WIDTH, labels, photos
from common.figures import text
from early_discard.figures import ScoredDrive, as_drive, by_class, figures, score_drive, score_photos, threshold_for_recall
from early_discard.network import Features, Head, NetworkError, export

TOLERANCE = 1e-3
"""Largest difference between OpenCV and torch that an export may have."""

RECALLS = {"survey": 0.95, "photos": 0.9, "simulated": 0.95}
"""Where the threshold is chosen. The goal is 0.9 on other roads: the backbone has been trained on the first and last, never on the photos."""


class ExportError(Exception):
    """Nothing usable was exported; the text is one sentence for the user."""


def load_head(checkpoint: Path) -> Head:
    """The averaged weights of a checkpoint."""
    head = Head()
    try:
        head.load_state_dict(torch.load(checkpoint, map_location="cpu")["average"])
    except (OSError, KeyError, RuntimeError) as error:
        raise ExportError(f"Cannot read the checkpoint {checkpoint}: {error}.") from error
    return head.eval()


class Scorer:
    """The exported file, run by OpenCV as the vehicle runs it."""

    def __init__(self, weights: Path):
        self.network = cv2.dnn.readNetFromONNX(str(weights))

    def __call__(self, image: np.ndarray) -> float:
        self.network.setInput(inference.normalise(inference.letterbox(image, INPUT_WIDTH, INPUT_HEIGHT)[0])[None])
        return float(self.network.forward()[0, 0])


def check_against_torch(scorer: Scorer, backbone: Path, head: torch.nn.Module) -> None:
    """Compare the whole graph in OpenCV with backbone and head apart."""
    features = Features(backbone)
    for seed in range(3):
        image = np.random.default_rng(seed).integers(0, 256, (INPUT_HEIGHT, INPUT_WIDTH, 3), np.uint8)
        image = cv2.GaussianBlur(image, (0, 0), 1.0 + 3 * seed)
        with torch.no_grad():
            expected = float(head(*(torch.from_numpy(level)[None] for level in features.of(image))))
        if not abs(scorer(image) - expected) <= TOLERANCE:
            raise ExportError(f"OpenCV's output differs from torch's by {abs(scorer(image) - expected):.2g} > {TOLERANCE}.")


def write_manifest(path: Path, weights: Path, threshold: float) -> None:
    """Describe `weights`, which lies beside the manifest."""
    content = {
        "name": path.stem, "file": weights.name, "sha256": sha256_of(weights), "classes": ["hazard"],
        "input": {
            "width": INPUT_WIDTH, "height": INPUT_HEIGHT, "channels": "rgb", "resize": "letterbox",
            "pad_value": inference.PAD_VALUE,
        },
        "normalisation": {"mean": [inference.MEAN] * 3, "std": [inference.STD] * 3},
        "head": {"type": "score", "output": "score"},
        "thresholds": {"hazard": threshold},
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))


def write_golden(path: Path, scorer: Scorer) -> None:
    """The expected score of the golden image."""
    content = {
        "image": "pixel(x, y, c) = (x * (c + 1) + 2 * y + x * y / 64) mod 256, integer division, c = 0 red",
        "width": INPUT_WIDTH, "height": INPUT_HEIGHT, "tolerance": TOLERANCE,
        "rows": [{"index": 0, "values": [round(scorer(golden_image(INPUT_WIDTH, INPUT_HEIGHT)), 6)]}],
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def say(name: str, drives: Dict[str, ScoredDrive], threshold: float) -> None:
    """One line of figures."""
    found = figures(drives, threshold)
    print(
        f"{name}: {found.frames} frames, {found.hazard_frames} with a hazard, AUC {text(found.ranking)}; at {threshold:.3f} recall "
        f"{text(found.recall)}, precision {text(found.precision)}, sent {text(found.share_sent)}, "
        f"events {text(found.event_recall)} of {found.events}", flush=True,
    )


def score_simulated(root: Path, scorer: Scorer) -> Dict[str, ScoredDrive]:
    """Simulated drives, whose frames lie far apart: an event each, as good as."""
    return {
        name: score_drive([DriveFrame(picture, 1000.0 * number) for number, picture in enumerate(drive)], scorer)
        for name, drive in labels.read_simulated(root)
    }


def say_photos(catalogue: sets.Catalogue, data: Path, scorer: Scorer, threshold: float) -> None:
    """The photos that nothing was trained or chosen on, by set and by class."""
    held_out = {name: score_photos(part, scorer) for name, part in photos.read_held_out(catalogue, data).items()}
    drives = {name: as_drive(part) for name, part in held_out.items()}
    say("held-out photos", drives, threshold)
    for name, drive in drives.items():
        say(f"  {name}", {name: drive}, threshold)
    for name, drive in by_class(held_out).items():
        say(f"  class {name}", {name: drive}, threshold)


def run(arguments: argparse.Namespace) -> None:
    """Export, check, calibrate, measure, describe."""
    if not arguments.out.is_dir():
        raise ExportError(f"The folder {arguments.out} does not exist.")
    head = load_head(arguments.training / "last.pt")
    backbone, weights = arguments.training / "backbone.onnx", arguments.out / f"{arguments.name}.onnx"
    exportable = export(head, backbone, weights)
    scorer = Scorer(weights)
    check_against_torch(scorer, backbone, exportable)
    calibration = {
        name: score_drive(drive, scorer)
        for name, drive in labels.read_sections(arguments.data, lambda name: name in labels.CALIBRATION_SECTIONS).items()
    }
    if not any(drive.hazards.any() for drive in calibration.values()):
        raise ExportError(f"No frame with a hazard in the sections {', '.join(labels.CALIBRATION_SECTIONS)} below {arguments.data}.")
    kinds = {"survey": calibration}
    if arguments.sets:
        catalogue = sets.read_catalogue(arguments.sets)
        chosen = {name: score_photos(part, scorer) for name, part in photos.read_calibration(catalogue, arguments.data).items()}
        kinds["photos"] = {name: as_drive(part) for name, part in chosen.items()}
    if arguments.simulated:
        kinds["simulated"] = score_simulated(arguments.simulated, scorer)
    counted = {name: drives for name, drives in kinds.items() if any(drive.hazards.any() for drive in drives.values())}
    thresholds = {name: threshold_for_recall(drives, RECALLS[name]) for name, drives in counted.items()}
    threshold = min(thresholds.values())
    print("thresholds: " + ", ".join(f"{name} {value:.3f} for a recall of {RECALLS[name]}" for name, value in thresholds.items()))
    validation = {
        name: score_drive(drive, scorer)
        for name, drive in labels.read_sections(arguments.data, lambda name: name in VALIDATION_SECTIONS).items()
    }
    for name, drives in (*((f"threshold's {kind}", drives) for kind, drives in kinds.items()), ("validation", validation)):
        say(name, drives, threshold)
    for name, drive in validation.items():
        say(f"  {name}", {name: drive}, threshold)
    if arguments.sets:
        say_photos(catalogue, arguments.data, scorer, threshold)
    write_manifest(arguments.out / f"{arguments.name}.yaml", weights, threshold)
    write_golden(arguments.out / f"{arguments.name}.golden.yaml", scorer)


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 exported, 2 the command line, the checkpoint or the data is wrong."""
    parser = argparse.ArgumentParser(description="Export the send / don't-send classifier.")
    parser.add_argument("--training", type=Path, default=Path("build/training/discard"), help="folder of train_discard.py")
    parser.add_argument("--name", default="early-discard", help="name of the model")
    parser.add_argument("--out", type=Path, default=Path("models"), help="folder of the models")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of labelled photos below --data, as in training")
    parser.add_argument("--simulated", type=Path, help="folder of simulated drives that training has not seen")
    parser.add_argument("--threads", type=int, default=1, help="threads of OpenCV and torch")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(options.threads)
    torch.set_num_threads(max(options.threads, 1))
    try:
        run(options)
    except (ExportError, NetworkError, DataError) as error:
        print(f"export_discard: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
