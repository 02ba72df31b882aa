#!/usr/bin/python3
"""Give a model its TorchScript file, for the torch engine, made from its ONNX file.

    training/export_torch.py models/hazards-base.yaml

Writes NAME.pt beside the manifest and its name and hash into the manifest, after comparing it with OpenCV on random
input. The rest of the manifest, comments included, stays as it is.
"""

import argparse
import re
import sys
from pathlib import Path
from typing import Dict, List, Optional

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from detector import onnx_model, torch_model
from detector.manifest import sha256_of
from detector.packing import pack

TOLERANCE = 1e-3
"""Largest difference between OpenCV and torch, in raw units, that a file may have."""


class ExportError(Exception):
    """Nothing usable was exported; the text is one sentence for the user."""


def with_keys(manifest: str, keys: Dict[str, str], after: str, hint: str = "") -> str:
    """The manifest's text with these keys after the line of key `after`, replacing older ones; all else stays, comments included."""
    kept = re.sub(rf"^({'|'.join(keys)}):.*\n", "", manifest, flags=re.MULTILINE)
    lines = "".join(f"{key}: {value}\n" for key, value in keys.items())
    changed, count = re.subn(rf"^({after}:.*\n)", lambda found: found.group(1) + lines, kept, flags=re.MULTILINE)
    if count != 1:
        raise ExportError(f"The manifest has {count} lines that begin with '{after}:', accepted is one{hint}.")
    return changed


def with_torch_file(manifest: str, torch_file: Path) -> str:
    """The manifest's text with the two keys of `torch_file` after the hash of the ONNX file."""
    return with_keys(manifest, {"torch_file": torch_file.name, "torch_sha256": sha256_of(torch_file)}, after="sha256")


def add_torch_file(manifest: Path) -> Path:
    """Make the file, check it, enter it; its path."""
    try:
        text = manifest.read_text()
        content = yaml.safe_load(text)
        weights, digest = manifest.parent / content["file"], content["sha256"]
        found = sha256_of(weights)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError) as error:
        raise ExportError(f"Cannot read the manifest {manifest} or its weights: {error!r}.") from error
    if found != digest:
        raise ExportError(f"{manifest}: the SHA-256 of {weights} is {found}, the manifest's is {digest}.")
    path = manifest.with_suffix(".pt")
    packed = weights.suffix == ".gz"
    try:
        network = torch_model.export_torch(weights, path)
    except torch_model.UnknownOperator as error:
        raise ExportError(f"{weights}: {error}") from error
    images = np.random.default_rng(1).normal(size=network.input_shape).astype(np.float32)
    difference = float(np.abs(onnx_model.opencv_outputs(weights, images) - torch_model.torch_outputs(path, images)).max())
    if not difference <= TOLERANCE:
        path.unlink()
        raise ExportError(f"torch's output for {weights} differs from OpenCV's by {difference:.2g} > {TOLERANCE}.")
    if packed:
        path = pack(path)
    manifest.write_text(with_torch_file(text, path))
    print(f"wrote {path} ({path.stat().st_size} bytes); OpenCV and torch differ by at most {difference:.2g}")
    return path


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 exported, 2 the command line or a model is wrong."""
    parser = argparse.ArgumentParser(description="Give a model its TorchScript file, made from its ONNX file.")
    parser.add_argument("manifests", type=Path, nargs="+", metavar="MANIFEST", help="models/NAME.yaml")
    options = parser.parse_args(arguments)
    try:
        for manifest in options.manifests:
            add_torch_file(manifest)
    except ExportError as error:
        print(f"export_torch: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
