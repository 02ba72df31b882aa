#!/usr/bin/python3
"""Export a checkpoint of the change network as ONNX (whole, encoder, head) with its manifest and golden outputs.

    training/export_change.py --checkpoint build/training/change_small/best.pt --name change-small \
        --validation build/training/change_validation --data ../shared/data

The averaged weights are exported. OpenCV's outputs of all graphs are compared with torch's. The thresholds are those
that have a false positive rate of 0.01 and of 0.10 on the validation pairs, and the figures are printed, both measured with
the exported file run by OpenCV.
"""

import argparse
import sys
from pathlib import Path
from typing import List, Optional

import cv2
import numpy as np
import torch
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from common.figures import text
from change import data, inference, onnx_model
from change.exported import load_averaged
from change.manifest import write_manifest
from change.network import ChangeNetwork, Network
from change.surroundings import ensemble_of
from change.validation import FALSE_POSITIVE_RATES, photo_pairs, registered_pairs, validate
from train_change import VALIDATION_PHOTOS, read_source

TOLERANCE = 1e-3
"""Largest difference between OpenCV and torch, as a probability, that an export may have."""

MOST_BYTES = 10_000_000
"""Of a file that is committed."""

DEFAULT_CHECKPOINT = Path("build/training/change_small/best.pt")
GOLDEN_PIXELS = 24
LEAST_CHANGED = 0.5
"""What a vehicle tells of is likelier than not: most streets have not changed at all, unlike the pairs that are calibrated on."""

UNCALIBRATED_THRESHOLD = 0.5
"""Without validation pairs."""


class ExportError(Exception):
    """Nothing usable was exported; the text is one sentence for the user."""


def load_ensemble(checkpoints: List[Path]) -> Network:
    """The network of a checkpoint; of several, with the refiners of all."""
    networks = [load_averaged(checkpoint) for checkpoint in checkpoints]
    if len(networks) == 1:
        return networks[0]
    if not all(isinstance(network, ChangeNetwork) for network in networks):
        raise ExportError("Several checkpoints are joined of change-small only.")
    apart = ("surroundings.", "objects.")  # the latter serve pretraining only: an exported network has none
    kept = [{name: value for name, value in network.state_dict().items() if not name.startswith(apart)} for network in networks]
    if not all(torch.equal(value, other[name]) for other in kept[1:] for name, value in kept[0].items()):
        raise ExportError("The checkpoints have learnt the surroundings of different networks: --start-from must be the same.")
    networks[0].surroundings = ensemble_of([network.surroundings for network in networks])
    return networks[0]


def check_against_torch(folder: Path, name: str, network: Network) -> None:
    """Compare OpenCV with torch, the whole graph and the two parts one after the other, on random and on the golden input."""
    rng = np.random.default_rng(1)
    shape = (1, 3, inference.INPUT_HEIGHT, inference.INPUT_WIDTH)
    validity = (rng.random((1, 1) + shape[2:]) > 0.05).astype(np.float32)
    drawn = (rng.normal(size=shape).astype(np.float32), rng.normal(size=shape).astype(np.float32), validity)
    whole, encoder, head = (onnx_model.OpenCvModel(onnx_model.file_of(folder, name, part)) for part in onnx_model.PARTS)
    for first, second, valid in (drawn, onnx_model.golden_inputs()):
        with torch.no_grad():
            expected = network.detect(*map(torch.from_numpy, (first, second, valid))).numpy()
        at_once = whole.run({"first": first, "second": second, "validity": valid})[0]
        for what, found in (("whole", at_once), ("in two parts", onnx_model.run_parts(encoder, head, first, second, valid))):
            difference = float(np.abs(found - expected).max())
            if not difference <= TOLERANCE:
                raise ExportError(f"OpenCV's output of {name} ({what}) differs from torch's by {difference:.2g} > {TOLERANCE}.")
            print(f"OpenCV ({what}) and torch differ by at most {difference:.2g}")


def write_golden(folder: Path, name: str) -> None:
    """Expected probabilities of the golden pair at pixels of equal steps."""
    first, second, validity = onnx_model.golden_inputs()
    whole = onnx_model.OpenCvModel(onnx_model.file_of(folder, name, "whole"))
    found = whole.run({"first": first, "second": second, "validity": validity})[0][0]
    pixels = np.linspace(0, found[0].size - 1, GOLDEN_PIXELS).astype(int)
    content = {
        "first": "pixel(x, y, c) = (x * (c + 1) + 2 * y + x * y / 64) mod 256, integer division, c = 0 red",
        "second": "the first, mirrored left to right", "validity": "0 for x < 16, else 1",
        "width": inference.INPUT_WIDTH, "height": inference.INPUT_HEIGHT, "tolerance": TOLERANCE,
        "pixels": [
            {"x": int(pixel % inference.INPUT_WIDTH), "y": int(pixel // inference.INPUT_WIDTH),
             "values": [round(float(value), 6) for value in found[:, pixel // inference.INPUT_WIDTH, pixel % inference.INPUT_WIDTH]]}
            for pixel in pixels
        ],
    }
    path = folder / f"{name}.golden.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def calibrate(arguments: argparse.Namespace) -> dict:
    """Thresholds by name; prints the figures of the validation pairs."""
    names = [f"changed_at_fpr_{rate:.2f}" for rate in FALSE_POSITIVE_RATES]
    if arguments.validation is None:
        return {"changed": UNCALIBRATED_THRESHOLD, **{name: UNCALIBRATED_THRESHOLD for name in names}}
    cache = (arguments.checkpoint or [DEFAULT_CHECKPOINT])[0].parent / "registration_validation.npz"
    source = read_source(arguments.validation, arguments.data, cache, True, arguments.registered)
    pairs = registered_pairs(source.pairs) + photo_pairs(source, VALIDATION_PHOTOS, 1)
    if not any(pair.part == "changes" for pair in pairs):
        raise ExportError(f"No pair with changes below {arguments.validation} could be registered.")
    detect = onnx_model.opencv_detector(onnx_model.file_of(arguments.out, arguments.name, "whole"))
    report = validate(detect, pairs)
    parts = {part: sum(pair.part == part for pair in pairs) for part in ("changes", "unchanged", "photos")}
    print("pairs: " + ", ".join(f"{part} {count}" for part, count in parts.items()))
    for name, value in report.figures().items():
        print(f"{name}: {text(value, 4)}")
    found = {name: report.of("changes").at_false_positive_rate(rate)["threshold"] for name, rate in zip(names, FALSE_POSITIVE_RATES)}
    return {"changed": max(found[names[0]], LEAST_CHANGED), **found}


def run(arguments: argparse.Namespace) -> None:
    """Export, check, calibrate, describe."""
    if arguments.closer_look and not 0.1 <= arguments.closer_look <= 0.9:
        raise ExportError(f"--closer-look must be 0 or from 0.1 to 0.9, not {arguments.closer_look}.")
    if not arguments.out.is_dir():
        raise ExportError(f"The folder {arguments.out} does not exist.")
    network = onnx_model.export(load_ensemble(arguments.checkpoint or [DEFAULT_CHECKPOINT]), arguments.out, arguments.name)
    for part in onnx_model.PARTS:
        size = onnx_model.file_of(arguments.out, arguments.name, part).stat().st_size
        if size > MOST_BYTES:
            print(f"{part}: {size} bytes, too large to be committed ({MOST_BYTES})")
    check_against_torch(arguments.out, arguments.name, network)
    write_golden(arguments.out, arguments.name)
    levels = len(network.encode(torch.zeros(1, 3, inference.INPUT_HEIGHT, inference.INPUT_WIDTH)))
    write_manifest(arguments.out, arguments.name, levels, calibrate(arguments), arguments.closer_look)
    print(f"wrote {arguments.out / arguments.name}.yaml and its graphs")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 exported, 2 the command line, the checkpoint or the data is wrong."""
    parser = argparse.ArgumentParser(description="Export a checkpoint of the change network as ONNX with its manifest.")
    parser.add_argument("--checkpoint", type=Path, action="append", help=f"default {DEFAULT_CHECKPOINT}; of train_change_surroundings.py it may be repeated: their mean counts")
    parser.add_argument("--name", default="change-small", help="name of the model")
    parser.add_argument("--out", type=Path, default=Path("models"), help="folder of the models")
    parser.add_argument("--validation", type=Path, help="held-out pairs (training/simulate_change.py --plain)")
    parser.add_argument("--registered", action="store_true", help="the pictures of all pairs lie upon each other already")
    parser.add_argument("--data", type=Path, help="folder of the data sets: held-out photos to paste objects into")
    parser.add_argument("--closer-look", type=float, default=0.0, metavar="SHARE", help="of a picture's width: its middle is looked at a second time, so that small things keep their pixels (0: not)")
    parser.add_argument("--threads", type=int, default=2, help="threads of OpenCV and torch")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(options.threads)
    torch.set_num_threads(max(options.threads, 1))
    try:
        run(options)
    except (ExportError, data.DataError) as error:
        print(f"export_change: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
