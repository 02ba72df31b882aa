#!/usr/bin/python3
"""Give a detector its TorchScript file in 8 bits, made from its ONNX file and calibrated on pictures of the training data.

    training/export_int8.py models/hazards-base.yaml --data ../shared/data --sets training/real_hazards.yaml

Writes NAME.int8.pt beside the manifest, enters its name, its hash, `precision: int8` and `engine: torch` into the manifest,
and what it answers for the golden picture into NAME.golden.yaml. The rest of the manifest, comments included, stays as it is. The
validation sections of the road survey, and what the sets hold out, are never calibrated on.
"""

import argparse
import sys
from pathlib import Path
from typing import Iterator, List, Optional, Sequence, Tuple

import cv2
import numpy as np
import torch
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from common.files import list_pictures
from detector import data, inference, int8_model, onnx_model, sets
from detector.manifest import ManifestError, read_manifest, sha256_of
from detector.packing import pack
from detector.torch_model import UnknownOperator
from export_torch import ExportError, with_keys

GOLDEN_TOLERANCE = 0.25
"""Of the golden rows, in raw units: a few steps of 8 bits, as other processors round sums differently."""

PICTURES = 96
"""To calibrate on, in equal parts of each group of pictures."""


def training_groups(options: argparse.Namespace) -> Iterator[List[Path]]:
    """Paths of training pictures by group."""
    if not data.is_none(options.data):
        folders = [folder for folder in data.section_folders(options.data) if folder.name not in data.VALIDATION_SECTIONS]
        yield [path for folder in folders for path in list_pictures(folder / "images")]
        yield list_pictures(options.data / "pothole_closeups" / "images")
        yield list_pictures(options.data / "traffic_cones" / "images" / "train")
    for one in sets.read_catalogue(options.sets).sets if options.sets else ():
        yield sets.training_paths(one, options.data)
    for folder in options.pictures:
        yield list_pictures(folder)


def chosen_pictures(options: argparse.Namespace) -> List[Path]:
    """As many of each group, at equal steps."""
    groups = [group for group in training_groups(options) if group]
    if not groups:
        raise ExportError("There is no picture to calibrate on, accepted are --data, --sets or --pictures with some.")
    share = -(-options.count // len(groups))
    return [group[index] for group in groups for index in sorted(set(np.linspace(0, len(group) - 1, share).astype(int)))]


def calibration_pictures(paths: Sequence[Path], view: inference.ViewConfig) -> Iterator[np.ndarray]:
    """Pictures as the network sees them, RGB."""
    for path in paths:
        picture = cv2.imread(str(path))
        if picture is None:
            raise ExportError(f"Cannot read the picture {path}.")
        yield inference.letterbox(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), view.width, view.height)[0]


def with_int8_file(manifest: str, int8_file: Path) -> str:
    """The manifest's text with the keys after those of the other files."""
    keys = {"int8_file": int8_file.name, "int8_sha256": sha256_of(int8_file), "precision": "int8", "engine": "torch"}
    return with_keys(manifest, keys, after="torch_sha256", hint=": training/export_torch.py adds it")


def enter_golden(path: Path, outputs: np.ndarray) -> None:
    """What the file answers for the golden picture, at the rows that are there already."""
    content = yaml.safe_load(path.read_text())
    rows = [row["index"] for row in content["rows"]]
    content["int8_tolerance"] = GOLDEN_TOLERANCE
    content["int8_rows"] = [{"index": row, "values": [round(float(value), 6) for value in outputs[0, row]]} for row in rows]
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def uniform_normalisation(path: Path) -> Tuple[int, float]:
    """Mean and std of all channels: in 8 bits a pixel is its own quantised value, which wants one whole mean."""
    entry = yaml.safe_load(path.read_text())["normalisation"]
    means, stds = set(map(float, entry["mean"])), set(map(float, entry["std"]))
    if len(means) != 1 or len(stds) != 1 or not 0 <= min(means) <= 255 or min(means) % 1:
        raise ExportError(f"{path}: normalisation is {entry}, accepted for 8 bits is one whole mean from 0 to 255 and one std for all channels.")
    return int(min(means)), min(stds)


def make_int8_file(
    weights: Path, view: inference.ViewConfig, options: argparse.Namespace, mean: int = int(inference.MEAN), std: float = inference.STD
) -> Path:
    """The file of an ONNX file, beside it and packed where that is; its path."""
    path = weights.with_name(weights.name.split(".onnx")[0] + ".int8.pt")
    paths = chosen_pictures(options)
    try:
        int8_model.export_int8(weights, path, calibration_pictures(paths, view), len(view.scales), mean, std)
    except UnknownOperator as error:
        raise ExportError(f"{weights}: {error}") from error
    if weights.suffix == ".gz":
        path = pack(path)
    print(f"wrote {path} ({path.stat().st_size} bytes), calibrated on {len(paths)} pictures")
    return path


def enter_int8_file(manifest: Path, int8_file: Path, view: inference.ViewConfig) -> None:
    """Enters the file into the manifest, and its answers into the golden file where there is one."""
    manifest.write_text(with_int8_file(manifest.read_text(), int8_file))
    golden = manifest.with_suffix(".golden.yaml")
    if golden.is_file():
        enter_golden(golden, int8_model.int8_outputs(int8_file, view.scales)(onnx_model.golden_image(view.width, view.height)))


def add_int8_file(manifest_path: Path, options: argparse.Namespace) -> None:
    """Makes the file and enters it."""
    manifest = read_manifest(manifest_path, known_classes=False)
    made = make_int8_file(manifest.weights, manifest.view, options, *uniform_normalisation(manifest_path))
    enter_int8_file(manifest_path, made, manifest.view)


def add_calibration_arguments(parser: argparse.ArgumentParser) -> None:
    """What both exporters are told of the pictures."""
    parser.add_argument("--pictures", type=Path, metavar="DIR", action="append", default=[], help="pictures of your own to calibrate 8 bits on; may be repeated")
    parser.add_argument("--count", type=int, default=PICTURES, help=f"pictures that 8 bits are calibrated on ({PICTURES})")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 exported, 2 the command line, a model or the data is wrong."""
    parser = argparse.ArgumentParser(description="Give a detector its TorchScript file in 8 bits.")
    parser.add_argument("manifests", type=Path, nargs="+", metavar="MANIFEST", help="models/NAME.yaml")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets; none: --pictures alone")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of photos as the training had them: their training parts calibrate too")
    parser.add_argument("--threads", type=int, default=1, help="threads of torch")
    add_calibration_arguments(parser)
    options = parser.parse_args(arguments)
    torch.set_num_threads(max(options.threads, 1))
    try:
        for manifest in options.manifests:
            add_int8_file(manifest, options)
    except (ExportError, ManifestError, data.DataError) as error:
        print(f"export_int8: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
