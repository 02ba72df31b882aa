#!/usr/bin/python3
"""Export a checkpoint as ONNX and TorchScript with its manifest and golden outputs.

    training/export_detector.py --checkpoint build/training/hazards/last.pt --name my-hazards --data ../shared/data

The averaged weights are exported; with several --checkpoint flags, of runs that began from one another, the
mean of all (model soup, Wortsman et al. 2022). Thresholds are calibrated on the validation parts of the data, with
the exported file run by OpenCV (in 8 bits, by torch): the pothole's by the limit on false reports, the cone's by the best F1, those of
classes without real pictures by the best F1 on simulated drives (--simulated; seeds that training has not seen), those of
a user's own by the best F1 on pictures that were held back (--own).
"""

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import cv2
import numpy as np
import torch
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from detector import CLASSES, data, inference, onnx_model, pretrained, sets
from detector.int8_model import int8_forward
from detector.manifest import ManifestError, classes_of, write_manifest
from detector.metrics import average_precision, best_f1_threshold, calibrate_threshold
from detector.network import SIZES, STRIDES, Detector
from detector.packing import pack, round_weights
from detector.validation import DetectorRunner, detect_labelled, validate
from export_int8 import add_calibration_arguments, enter_int8_file, make_int8_file
from export_torch import ExportError, add_torch_file

TOLERANCE = 1e-3
"""Largest difference between OpenCV and torch, in raw units, that an export may have."""

GOLDEN_ROWS = 24

MOST_ON_DRIVES = 1.0
"""Reports per km of a class on survey drives that show hardly any of it, at the threshold that photos of the sets choose."""

LEAST_THRESHOLD = 0.2
"""Of a class learnt from simulated drives: one that is hardly found would otherwise be reported everywhere."""

UNCALIBRATED_THRESHOLD = 0.5
"""Of a class without pictures to calibrate it on."""

DEFAULT_CHECKPOINT = Path("build/training/hazards/last.pt")


@dataclass
class Loaded:
    """A network and what its outputs are called."""

    detector: Detector
    classes: Tuple[str, ...]


def load_exported_again(weights: Path) -> Loaded:
    """An exported network, of whatever size it is."""
    classes = classes_of(weights)
    for size in SIZES.values():
        detector = Detector(len(classes), size)
        convolutions = sum(isinstance(module, torch.nn.Conv2d) for module in detector.modules())
        if pretrained.load_exported(detector, weights) == convolutions:
            return Loaded(detector, classes)
    raise ExportError(f"{weights} is a network of none of the sizes {', '.join(SIZES)} with {len(classes)} classes.")


def load_checkpoint(checkpoint: Path) -> Loaded:
    """The averaged weights of a checkpoint, or the weights of an exported .onnx; normalisation folded, so that means of several make sense."""
    if ".onnx" in checkpoint.suffixes:
        return load_exported_again(checkpoint)
    try:
        state = torch.load(checkpoint, map_location="cpu")
        classes = tuple(state["settings"].get("classes", CLASSES))  # older ones do not say them
        detector = Detector(len(classes), SIZES[state["settings"]["size"]])
        detector.load_state_dict(state["average"])
    except (OSError, KeyError, RuntimeError) as error:
        raise ExportError(f"Cannot read the checkpoint {checkpoint}: {error}.") from error
    pretrained.fold_normalisation(detector.eval())
    return Loaded(detector, classes)


def load_averaged(checkpoints: List[Path]) -> Loaded:
    """The weights of a checkpoint, or the mean of those of several."""
    loaded = [load_checkpoint(checkpoint) for checkpoint in checkpoints]
    if any(each.classes != loaded[0].classes for each in loaded):
        raise ExportError("The checkpoints are of networks with different classes.")
    detectors = [each.detector for each in loaded]
    mean = detectors[0].state_dict()
    for name, value in mean.items():
        if value.dtype.is_floating_point:
            try:
                mean[name] = torch.stack([detector.state_dict()[name] for detector in detectors]).mean(dim=0)
            except (KeyError, RuntimeError) as error:
                raise ExportError("The checkpoints are of networks of different sizes.") from error
    detectors[0].load_state_dict(mean)
    return Loaded(detectors[0].eval(), loaded[0].classes)


def input_size(text: str) -> Tuple[int, int]:
    """Width and height of the network's input, from WIDTHxHEIGHT."""
    found = re.fullmatch(r"([1-9]\d{1,3})x([1-9]\d{1,3})", text)
    size = (int(found[1]), int(found[2])) if found else (0, 0)
    if not found or any(side % STRIDES[-1] for side in size):
        raise argparse.ArgumentTypeError(f"'{text}' is no WIDTHxHEIGHT in multiples of {STRIDES[-1]}")
    return size


def view_scales(text: str) -> Tuple[float, ...]:
    """Scales of the views from text like 1,0.8; at each a cell must be whole pixels of the input."""
    try:
        scales = tuple(float(part) for part in text.split(","))
    except ValueError:
        scales = ()
    fitting = [scale for scale in scales if 0.25 <= scale <= 1 and all(abs(stride / scale - round(stride / scale)) < 1e-9 for stride in STRIDES)]
    if not 1 <= len(scales) <= 4 or len(fitting) != len(scales):
        raise argparse.ArgumentTypeError(f"'{text}' is no list of 1 to 4 scales such as 1, 0.8 and 0.5, of which {STRIDES[0]} is a whole multiple")
    return scales


def view_of(arguments: argparse.Namespace) -> inference.ViewConfig:
    """The input and the views of it; every view must be covered by whole cells."""
    view = inference.ViewConfig(*arguments.input, arguments.scales, arguments.mirrored)
    for scale in view.scales:
        if any(abs(side * scale / STRIDES[-1] - round(side * scale / STRIDES[-1])) > 1e-9 for side in arguments.input):
            raise ExportError(f"--scales: {scale} of --input {view.width}x{view.height} is no multiple of {STRIDES[-1]} pixels.")
    return view


def check_against_torch(weights: Path, exportable: torch.nn.Module, size: Tuple[int, int]) -> None:
    """Compare OpenCV with torch on random input."""
    images = np.random.default_rng(1).normal(size=(1, 3, size[1], size[0])).astype(np.float32)
    with torch.no_grad():
        expected = exportable(torch.from_numpy(images)).numpy()
    difference = float(np.abs(onnx_model.opencv_outputs(weights, images) - expected).max())
    if not difference <= TOLERANCE:
        raise ExportError(f"OpenCV's output of {weights} differs from torch's by {difference:.2g} > {TOLERANCE}.")
    print(f"OpenCV and torch differ by at most {difference:.2g}")


def write_golden(path: Path, weights: Path, size: Tuple[int, int]) -> None:
    """Expected output rows for the golden image, at equal steps over all anchor points."""
    image = inference.normalise(onnx_model.golden_image(*size))
    predictions = onnx_model.opencv_outputs(weights, image[None])[0]
    rows = np.linspace(0, len(predictions) - 1, GOLDEN_ROWS).astype(int)
    content = {
        "image": "pixel(x, y, c) = (x * (c + 1) + 2 * y + x * y / 64) mod 256, integer division, c = 0 red",
        "width": size[0], "height": size[1], "tolerance": TOLERANCE,
        "anchor_points": len(predictions),
        "rows": [
            {"index": int(row), "values": [round(float(value), 6) for value in predictions[row]]} for row in rows
        ],
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def calibrate(runner: DetectorRunner, arguments: argparse.Namespace, classes: Tuple[str, ...], drives: dict, cones: list) -> Dict[str, float]:
    """A threshold for each class; real pictures count more than simulated ones, and own ones most.

    Photos of the sets nearly all show a hazard: there the threshold is not lower than the survey's drives allow, which show none.
    """
    thresholds = {name: UNCALIBRATED_THRESHOLD for name in classes}
    found = validate(runner, drives, cones)
    simulated = data.read_simulated(arguments.simulated) if arguments.simulated else []
    of_sets = sets.read_pictures(sets.read_catalogue(arguments.sets), arguments.data).held_out if arguments.sets else {}
    parts = {"simulated": [simulated], "held-out": of_sets.values(), "own": data.read_own(arguments.own, classes).values()}
    for kind, groups in parts.items():
        for name, frames in detect_labelled(runner, [picture for group in groups for picture in group], classes).items():
            if any(len(frame.labels) for frame in frames):
                thresholds[name] = max(best_f1_threshold(frames, 0.5), LEAST_THRESHOLD)
                if kind == "held-out" and drives:
                    thresholds[name] = max(thresholds[name], calibrate_threshold(found.others_on_drives[classes.index(name)], MOST_ON_DRIVES))
                print(f"{kind} {name}: AP50 {average_precision(frames, 0.5):.3f} at threshold {thresholds[name]}")
    if drives:
        thresholds["pothole"] = found.best_drive_figures().threshold
    if cones:
        thresholds["traffic_cone"] = best_f1_threshold(found.cones, 0.5)
    return thresholds


def run(arguments: argparse.Namespace) -> None:
    """Export, check, calibrate, describe."""
    if not arguments.out.is_dir():
        raise ExportError(f"The folder {arguments.out} does not exist.")
    view = view_of(arguments)
    loaded = load_averaged(arguments.checkpoint or [DEFAULT_CHECKPOINT])
    strangers = set(data.with_own_classes(arguments.own)) - set(loaded.classes)
    if strangers:
        raise ExportError(f"--own has the class {min(strangers)}, which the checkpoint was not trained on.")
    drives = data.read_validation_drives(arguments.data)
    cones = data.read_validation_cones(arguments.data)

    weights = arguments.out / f"{arguments.name}.onnx"
    exportable = onnx_model.export(loaded.detector, weights, view)
    check_against_torch(weights, exportable, arguments.input)
    if arguments.packed:
        round_weights(weights)
        weights = pack(weights)
    write_golden(arguments.out / f"{arguments.name}.golden.yaml", weights, arguments.input)

    int8_file = make_int8_file(weights, view, arguments) if arguments.precision == "int8" else None
    # Scores in 8 bits are a little lower: the thresholds are those of the form that vehicles run.
    runner = DetectorRunner(int8_forward(int8_file, view) if int8_file else onnx_model.opencv_forward(weights), view)
    thresholds = calibrate(runner, arguments, loaded.classes, drives, cones)
    manifest = arguments.out / f"{arguments.name}.yaml"
    write_manifest(manifest, weights, thresholds, view, arguments.engine)
    add_torch_file(manifest)
    if int8_file:
        enter_int8_file(manifest, int8_file, view)
    print(f"wrote {weights} and its manifest, thresholds {thresholds}")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 exported, 2 the command line, the checkpoint or the data is wrong."""
    parser = argparse.ArgumentParser(description="Export a checkpoint as ONNX with its manifest.")
    parser.add_argument("--checkpoint", type=Path, action="append", help=f"default {DEFAULT_CHECKPOINT}; may be repeated; an exported .onnx will do")
    parser.add_argument("--name", required=True, help="name of the model; files of the same name in --out are replaced")
    parser.add_argument("--out", type=Path, default=Path("models"), help="folder of the models")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets; none: calibrate on own and simulated pictures alone")
    parser.add_argument("--own", type=Path, metavar="DIR", action="append", default=[], help="pictures of your own that were held back from training; may be repeated")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of photos as the training had them: their held-out parts calibrate")
    parser.add_argument("--simulated", type=Path, help="folder of simulated validation drives (training/simulate_drives.py)")
    parser.add_argument("--input", type=input_size, default=(inference.INPUT_WIDTH, inference.INPUT_HEIGHT), metavar="WIDTHxHEIGHT", help="of the network (640x400)")
    parser.add_argument("--scales", type=view_scales, default=(1.0,), metavar="S,...", help="views of the picture whose findings are fused (1)")
    parser.add_argument("--mirrored", action="store_true", help="the mirrored picture is looked at besides, at the same scales")
    parser.add_argument("--engine", choices=("opencv", "torch"), default="", help="entered into the manifest; else the vehicle's default")
    parser.add_argument("--precision", choices=("fp32", "int8"), default="fp32", help="int8: a file in 8 bits besides, which libtorch runs (fp32)")
    add_calibration_arguments(parser)
    parser.add_argument("--packed", action="store_true", help="weights of half the precision, in gzip files")
    parser.add_argument("--threads", type=int, default=2, help="threads of OpenCV and torch")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(options.threads)
    torch.set_num_threads(max(options.threads, 1))
    try:
        run(options)
    except (ExportError, ManifestError, data.DataError, pretrained.ConversionError) as error:
        print(f"export_detector: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
