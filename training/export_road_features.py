#!/usr/bin/python3
"""Give a change model a road look: export a detector's features as NAME.road.onnx and enter them in NAME.yaml.

    training/export_road_features.py --detector models/hazards-base.onnx --data ../shared/data --name change-small

Run it after training/export_change.py, which writes the manifest anew. The channels are measured on photos of the set of
training/change_pairs.yaml that no pair is made of. OpenCV's output is compared with torch's.
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
from change import road_features
from change.roads import pictures_of_pairs
from common.files import DataError
from detector import sets
from detector.manifest import sha256_of
from detector.onnx_model import golden_image

TOLERANCE = 5e-3
"""Largest difference between OpenCV and torch, in deviations of a channel."""

GOLDEN_VALUES = 24

ROAD = {"width": road_features.WIDTH, "height": road_features.HEIGHT, "output": road_features.OUTPUT, "least_agreement": 0.45,
        "features": 3.0, "colours": 0.75, "bias": -6.3}
"""What of the manifest models/README.md describes under `road`; how the numbers were found is in the notebook of the change network."""


def read_photos(data: Path, catalogue_path: Path, pairs_path: Path, most: int) -> List[np.ndarray]:
    """Photos of the pairs' set, RGB, none of a pair."""
    place_set, used = pictures_of_pairs(pairs_path)
    folder = data / next(one.folder for one in sets.read_catalogue(catalogue_path).sets if one.name == place_set) / "images"
    paths = [path for path in sorted(folder.glob("*.jpg")) if path.stem not in used]
    if not paths:
        raise DataError(f"{folder} has no photo that is not of a pair.")
    return [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in paths[:: max(len(paths) // most, 1)][:most]]


def opencv_features(path: Path, image: np.ndarray) -> np.ndarray:
    """1 x C x h x w for a normalised 3 x H x W image."""
    network = cv2.dnn.readNetFromONNX(str(path))
    network.setInput(image[None])
    return network.forward(road_features.OUTPUT)


def write_golden(path: Path, found: np.ndarray) -> None:
    """Expected features of the golden image at equal steps of the tensor."""
    indices = np.linspace(0, found.size - 1, GOLDEN_VALUES).astype(int)
    content = {
        "image": "pixel(x, y, c) = (x * (c + 1) + 2 * y + x * y / 64) mod 256, integer division, c = 0 red",
        "width": road_features.WIDTH, "height": road_features.HEIGHT, "tolerance": TOLERANCE,
        "values": [{"index": int(index), "value": round(float(found.flat[index]), 5)} for index in indices],
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def run(options: argparse.Namespace) -> None:
    """Export, check, enter."""
    detector = road_features.read_detector(options.detector)
    photos = read_photos(options.data, options.sets, options.pairs, options.photos)
    features = road_features.RoadFeatures(detector, road_features.deviations_on(detector, photos)).eval()
    manifest = options.out / f"{options.name}.yaml"
    path = options.out / f"{options.name}.road.onnx"
    road_features.export(features, path)
    image = road_features.normalise(golden_image(road_features.WIDTH, road_features.HEIGHT))
    with torch.no_grad():
        expected = features(torch.from_numpy(image)[None]).numpy()
    found = opencv_features(path, image)
    difference = float(np.abs(found - expected).max())
    if not difference <= TOLERANCE:
        raise DataError(f"OpenCV's features differ from torch's by {difference:.2g} > {TOLERANCE}.")
    write_golden(options.out / f"{options.name}.road.golden.yaml", found)
    content = yaml.safe_load(manifest.read_text())
    content["graphs"]["road"] = {"file": path.name, "sha256": sha256_of(path)}
    content["road"] = ROAD
    manifest.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))
    print(f"{len(photos)} photos; OpenCV and torch differ by at most {difference:.2g}; {path.stat().st_size} bytes")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 exported, 2 the command line, the detector or the data is wrong."""
    parser = argparse.ArgumentParser(description="Give a change model a road look.")
    parser.add_argument("--detector", type=Path, default=Path("models/hazards-base.onnx"), help="exported detector of size medium")
    parser.add_argument("--name", default="change-small", help="name of the change model")
    parser.add_argument("--out", type=Path, default=Path("models"), help="folder of the models")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--sets", type=Path, default=Path("training/real_hazards.yaml"), help="catalogue of the photo sets")
    parser.add_argument("--pairs", type=Path, default=Path("training/change_pairs.yaml"), help="pairs whose pictures are left out")
    parser.add_argument("--photos", type=int, default=24, help="on which the channels are measured")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    try:
        run(options)
    except (DataError, OSError) as error:
        print(f"export_road_features: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
