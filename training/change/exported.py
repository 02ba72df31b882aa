"""Taking up the weights of an exported network again, where its checkpoint is not at hand."""

from pathlib import Path
from typing import Iterable

import onnx
import torch
from onnx import numpy_helper
from torch import nn

from detector.data import DataError

from .blocks import ConvBlock
from .network import ARCHITECTURES, ChangeNetwork, Network
from .surroundings import with_present_names


@torch.no_grad()
def load_exported(path: Path) -> ChangeNetwork:
    """A change-small with the weights of the whole graph (NAME.onnx), for inference: its normalisation does nothing any more.

    What an export of an earlier version lacks (its refiners) is untrained.
    """
    try:
        initializers = onnx.load(str(path)).graph.initializer
        stored = {entry.name.removeprefix("network."): torch.from_numpy(numpy_helper.to_array(entry).copy()) for entry in initializers}
        stored = with_present_names(stored)
    except Exception as error:  # python3-onnx passes on what protobuf throws.
        raise DataError(f"Cannot read the exported network {path}: {error}.") from error
    network = ChangeNetwork(refiners=max(refiners_of(stored), 1)).eval()
    for name, module in network.named_modules():
        if isinstance(module, ConvBlock):
            put_into(module, stored, f"{name}.0")
        elif isinstance(module, nn.Conv2d) and f"{name}.weight" in stored:
            copy(module.weight, stored, f"{name}.weight", path)
            if module.bias is not None:
                copy(module.bias, stored, f"{name}.bias", path)
    missing = [name for name, module in network.named_modules() if isinstance(module, ConvBlock) and f"{name}.0.weight" not in stored]
    if any(not name.startswith("surroundings.") for name in missing):
        raise DataError(f"{path} is no exported change-small: it has no {missing[0]}.")
    return network


def load_averaged(checkpoint: Path) -> Network:
    """The averaged weights of a checkpoint, or the weights of a whole exported graph."""
    if checkpoint.suffix == ".onnx":
        return load_exported(checkpoint)
    try:
        state = torch.load(checkpoint, map_location="cpu")
        weights, architecture = with_present_names(state["average"]), ARCHITECTURES[state["settings"]["architecture"]]
        network = ChangeNetwork(refiners=max(refiners_of(weights), 1)) if architecture is ChangeNetwork else architecture()
        network.load_state_dict(weights)
    except Exception as error:  # torch tries one format after the other, each with exceptions of its own
        raise DataError(f"Cannot read the checkpoint {checkpoint}: {error}.") from error
    return network.eval()


def refiners_of(weights: Iterable[str]) -> int:
    """How many refiners weights of these names have."""
    return len({name.split(".")[2] for name in weights if name.startswith("surroundings.refiners.")})


def hold_normalisation(network: nn.Module) -> None:
    """Keep every normalisation as it is while the network trains: what an export folded into the convolutions is not measured anew."""
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.eval()


def put_into(block: ConvBlock, stored: dict, name: str) -> None:
    """A folded convolution into a block, whose normalisation then adds the bias and does nothing else."""
    if f"{name}.weight" not in stored:
        return
    copy(block[0].weight, stored, f"{name}.weight", name)
    copy(block[1].bias, stored, f"{name}.bias", name)
    block[1].running_mean.zero_()
    block[1].running_var.fill_(1 - block[1].eps)
    block[1].weight.fill_(1)


def copy(parameter: torch.Tensor, stored: dict, name: str, where: object) -> None:
    """A stored tensor over a parameter of the same shape."""
    value = stored.get(name)
    if value is None or value.shape != parameter.shape:
        raise DataError(f"{where}: {name} is no tensor of the shape {tuple(parameter.shape)}.")
    parameter.copy_(value)
