#!/usr/bin/python3
"""Write a change network's probabilities for pairs, for `livemap evaluate change DIR --predictions`.

    training/predict_change.py --manifest models/change-small.yaml --pairs DIR --out build/predictions
    training/predict_change.py --checkpoint build/training/thesis/best.pt --pairs DIR --out build/predictions --registered
    livemap evaluate change DIR --predictions build/predictions/forward --reversed-predictions build/predictions/reversed

Per pair OUT/forward/NNN/II.npy and OUT/reversed/NNN/II.npy (the same with the pictures swapped): float32, classes x height x
width of the pair's pictures. Where the earlier picture shows nothing, and of a pair that cannot be registered, they are what the
network believes without it; a vehicle says nothing there. --registered takes pairs as they are.
"""

import argparse
import sys
from pathlib import Path
from typing import List, Optional, Tuple

import cv2
import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parent))
from change import data, onnx_model
from change.inference import INPUT_HEIGHT, INPUT_WIDTH
from change.manifest import read_manifest
from change.validation import Detect, aligned, torch_detector
from detector.manifest import ManifestError
from export_change import ExportError, load_averaged


def enlarge(probabilities: np.ndarray, width: int, height: int) -> np.ndarray:
    """From the network's letterboxed size to a picture's."""
    scale = min(INPUT_WIDTH / width, INPUT_HEIGHT / height)
    shown = probabilities[:, : round(height * scale), : round(width * scale)]
    return np.stack([cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR) for plane in shown])


def predict(detect: Detect, pair: data.Pair) -> Tuple[np.ndarray, np.ndarray]:
    """Probabilities in the network's size, in both orders."""
    first, validity = aligned(pair)
    return detect(first, pair.second, validity), detect(pair.second, first, validity)


def run(options: argparse.Namespace) -> None:
    """All pairs of a data set."""
    if (options.manifest is None) == (options.checkpoint is None):
        raise ExportError("Exactly one of --manifest and --checkpoint is needed.")
    if options.manifest is not None:
        detect = onnx_model.opencv_detector(read_manifest(options.manifest).files["whole"])
    else:
        detect = torch_detector(load_averaged(options.checkpoint), torch.device("cpu"), "fp32")
    refused = 0
    paths = data.pair_paths(options.pairs)
    for path in paths:
        pair = data.read_pair(path, {}, None)
        pair.homography = np.eye(3) if options.registered else pair.register()
        refused += pair.homography is None
        height, width = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).shape[:2]
        for order, found in zip(("forward", "reversed"), predict(detect, pair)):
            out = options.out / order / path.parents[1].name / f"{path.stem[2:]}.npy"
            out.parent.mkdir(parents=True, exist_ok=True)
            np.save(out, enlarge(found, width, height).astype(np.float32))
    print(f"{len(paths)} pairs, {refused} of them not registered")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 written, 2 the command line, the model or the data is wrong."""
    parser = argparse.ArgumentParser(description="Write a change network's probabilities for pairs.")
    parser.add_argument("--manifest", type=Path, help="of an exported model, run by OpenCV")
    parser.add_argument("--checkpoint", type=Path, help="of training/train_change.py, run by torch")
    parser.add_argument("--pairs", type=Path, required=True, help="one data set as VL-CMU-CD lays it out")
    parser.add_argument("--out", type=Path, required=True, help="folder for forward/ and reversed/")
    parser.add_argument("--registered", action="store_true", help="the pairs are registered already")
    parser.add_argument("--threads", type=int, default=2, help="threads of OpenCV and torch")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(options.threads)
    torch.set_num_threads(max(options.threads, 1))
    try:
        run(options)
    except (ExportError, ManifestError, data.DataError) as error:
        print(f"predict_change: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
