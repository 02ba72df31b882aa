"""The manifest of a change model: its three graphs, how to feed them, and from which score on a pixel is changed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Tuple

import yaml

from detector.manifest import ManifestError, sha256_of

from . import inference
from .classes import CLASSES
from .onnx_model import OUTPUT, PARTS, file_of


@dataclass(frozen=True)
class Manifest:
    """The checked fields that running the model needs."""

    files: Dict[str, Path]  # by part
    classes: Tuple[str, ...]
    width: int
    height: int
    thresholds: Dict[str, float]


def write_manifest(folder: Path, name: str, levels: int, thresholds: Dict[str, float], closer_look: float = 0.0) -> None:
    """Describe the graphs NAME.onnx, NAME.encoder.onnx and NAME.head.onnx of a folder.

    `closer_look` is the share of a picture's width whose middle is looked at a second time; 0: not at all.
    """
    files = {part: file_of(folder, name, part) for part in PARTS}
    content = {
        "name": name,
        "kind": "change",
        "graphs": {part: {"file": path.name, "sha256": sha256_of(path)} for part, path in files.items()},
        "classes": list(CLASSES),
        "input": {
            "width": inference.INPUT_WIDTH, "height": inference.INPUT_HEIGHT, "channels": "rgb", "resize": "letterbox",
            "pad_value": inference.PAD_VALUE, "invalid": "other_picture",
            **({"closer_look": closer_look} if closer_look else {}),
        },
        "normalisation": {"mean": [inference.MEAN] * 3, "std": [inference.STD] * 3},
        "head": {"type": "change", "levels": levels, "output": OUTPUT},
        "thresholds": {name: round(value, 6) for name, value in thresholds.items()},
    }
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))


def read_manifest(path: Path) -> Manifest:
    """Read a manifest and check its graphs against it."""
    try:
        content = yaml.safe_load(path.read_text())
        files = {part: path.parent / content["graphs"][part]["file"] for part in PARTS}
        digests = {part: content["graphs"][part]["sha256"] for part in PARTS}
        manifest = Manifest(
            files, tuple(content["classes"]), int(content["input"]["width"]), int(content["input"]["height"]),
            {name: float(value) for name, value in content["thresholds"].items()},
        )
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise ManifestError(f"Cannot read the manifest {path}: {error!r}.") from error
    if manifest.classes != CLASSES:
        raise ManifestError(f"{path}: classes are {manifest.classes}, this program knows {CLASSES}.")
    for part, file in files.items():
        if not file.is_file():
            raise ManifestError(f"{path}: the weights {file} do not exist.")
        if sha256_of(file) != digests[part]:
            raise ManifestError(f"{path}: the SHA-256 of {file} is not the manifest's {digests[part]}.")
    return manifest
