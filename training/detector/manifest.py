"""Model manifests: what a weights file is, how to feed it and how to read it. See models/README.md."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Tuple

import yaml

from . import CLASSES, inference
from .network import STRIDES


class ManifestError(Exception):
    """A manifest or its weights are not usable; the text is one sentence for the user."""


@dataclass(frozen=True)
class Manifest:
    """The checked fields that running the model needs."""

    weights: Path
    classes: Tuple[str, ...]
    view: inference.ViewConfig
    thresholds: Dict[str, float]


def sha256_of(path: Path) -> str:
    """Hexadecimal SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_manifest(
    path: Path, weights: Path, thresholds: Dict[str, float], view: inference.ViewConfig = inference.ViewConfig(), engine: str = ""
) -> None:
    """Describe `weights`, which lies beside the manifest; `thresholds` has the classes in their order, no `engine` leaves it open."""
    views = {**({"views": len(view.scales)} if len(view.scales) > 1 else {}), **({"mirrored": True} if view.mirrored else {})}
    content = {
        "name": path.stem,
        "file": weights.name,
        "sha256": sha256_of(weights),
        **({"engine": engine} if engine else {}),
        "classes": list(thresholds),
        "input": {
            "width": view.width, "height": view.height, "channels": "rgb",
            "resize": "letterbox", "pad_value": inference.PAD_VALUE,
        },
        "normalisation": {"mean": [inference.MEAN] * 3, "std": [inference.STD] * 3},
        "head": {"type": "yolox", "strides": inference.strides_of(view.scales), **views, "output": "predictions"},
        "thresholds": thresholds,
        "nms_iou": inference.NMS_IOU,
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))


def read_manifest(path: Path) -> Manifest:
    """Read a manifest and check its weights against it."""
    try:
        content = yaml.safe_load(path.read_text())
        strides = [int(stride) for stride in content["head"]["strides"]]
        view = inference.ViewConfig(
            int(content["input"]["width"]), int(content["input"]["height"]),
            tuple(STRIDES[0] / first for first in strides[:: len(STRIDES)]), bool(content["head"].get("mirrored", False)),
        )
        thresholds = {name: float(value) for name, value in content["thresholds"].items()}
        manifest = Manifest(path.parent / content["file"], tuple(content["classes"]), view, thresholds)
        digest = content["sha256"]
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise ManifestError(f"Cannot read the manifest {path}: {error!r}.") from error
    if manifest.classes[: len(CLASSES)] != CLASSES:
        raise ManifestError(f"{path}: classes are {manifest.classes}, which do not begin with {CLASSES}.")
    if not manifest.weights.is_file():
        raise ManifestError(f"{path}: the weights {manifest.weights} do not exist.")
    if sha256_of(manifest.weights) != digest:
        raise ManifestError(f"{path}: the SHA-256 of {manifest.weights} is not the manifest's {digest}.")
    return manifest


def classes_of(weights: Path) -> Tuple[str, ...]:
    """What the outputs of an exported network are called: by the manifest beside it, CLASSES where there is none."""
    manifest = weights.parent / f"{weights.name.split('.')[0]}.yaml"
    return read_manifest(manifest).classes if manifest.is_file() else CLASSES
