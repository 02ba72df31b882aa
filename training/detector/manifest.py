"""Model manifests: what a weights file is, how to feed it and how to read it. See models/README.md."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Optional, Tuple

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
    int8: Optional[Path] = None  # the TorchScript file in 8 bits
    precision: str = "fp32"


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


def check_hash(path: Path, weights: Path, digest: str) -> None:
    """Refuse weights that are missing or others than the manifest's."""
    if not weights.is_file():
        raise ManifestError(f"{path}: the weights {weights} do not exist.")
    if sha256_of(weights) != digest:
        raise ManifestError(f"{path}: the SHA-256 of {weights} is not the manifest's {digest}.")


def read_manifest(path: Path, known_classes: bool = True) -> Manifest:
    """Read a manifest and check its weights against it; `known_classes`: its classes must begin with CLASSES."""
    try:
        content = yaml.safe_load(path.read_text())
        strides = [int(stride) for stride in content["head"]["strides"]]
        view = inference.ViewConfig(
            int(content["input"]["width"]), int(content["input"]["height"]),
            tuple(STRIDES[0] / first for first in strides[:: len(STRIDES)]), bool(content["head"].get("mirrored", False)),
        )
        thresholds = {name: float(value) for name, value in content["thresholds"].items()}
        int8 = path.parent / content["int8_file"] if "int8_file" in content else None
        manifest = Manifest(
            path.parent / content["file"], tuple(content["classes"]), view, thresholds, int8, content.get("precision", "fp32"))
        digest, int8_digest = content["sha256"], content["int8_sha256"] if int8 else None
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise ManifestError(f"Cannot read the manifest {path}: {error!r}.") from error
    if known_classes and manifest.classes[: len(CLASSES)] != CLASSES:
        raise ManifestError(f"{path}: classes are {manifest.classes}, which do not begin with {CLASSES}.")
    if manifest.precision not in ("fp32", "int8") or (manifest.precision == "int8" and not int8):
        raise ManifestError(f"{path}: precision is '{manifest.precision}', accepted are fp32, and int8 with an int8_file.")
    check_hash(path, manifest.weights, digest)
    if int8:
        check_hash(path, int8, int8_digest)
    return manifest


def classes_of(weights: Path) -> Tuple[str, ...]:
    """What the outputs of an exported network are called: by the manifest beside it, CLASSES where there is none."""
    manifest = weights.parent / f"{weights.name.split('.')[0]}.yaml"
    return read_manifest(manifest).classes if manifest.is_file() else CLASSES
