"""A backbone's weights from a TensorFlow.js graph model of NanoDet-g.

The published file holds convolutions with biases, their batch normalisation folded in. Here it is read, checked by
running the graph node by node, and put into our backbone with its normalisation unfolded again, so that it trains
as a new one would.
"""

import base64
import json
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.fusion import fuse_conv_bn_eval

from .inference import MEAN, STD
from .network import ConvBlock, Detector
from .packing import model_bytes

NODE_PREFIX = "PartitionedCall/"
LEVEL_NODES = tuple(NODE_PREFIX + "onnx_tf_prefix_Concat_" + number for number in ("12", "27", "42", "62"))
"""The graph's nodes that give the features at strides 4, 8, 16 and 32."""

MEAN_BGR, STD_BGR = (103.53, 116.28, 123.675), (57.375, 57.12, 58.395)
"""What NanoDet was trained with: (pixel - mean) / std, channels in the order blue, green, red."""

LEAST_DEVIATION = 1e-2
"""Of a channel before its normalisation; one that is nearly constant is not blown up."""


class ConversionError(Exception):
    """The weights are missing or not those expected; the text is one sentence for the user."""


class GraphModel:
    """A TensorFlow.js graph model whose nodes can be evaluated one by one (the few kinds that a backbone needs)."""

    def __init__(self, model: Path):
        try:
            content = json.loads(model.read_text())
            self.weights = read_weights(content["weightsManifest"], model.parent)
            self.nodes = {node["name"]: node for node in content["modelTopology"]["node"]}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ConversionError(f"Cannot read the graph model {model}: {error!r}.") from error

    def convolutions(self, count: int) -> List[Tuple[Tensor, Tensor]]:
        """The first `count` convolutions in their order of execution: weights (out x in x 3 x 3) and biases."""
        try:
            suffixes = [""] + [f"_{number}" for number in range(1, count)]
            kernels = [self.weights[self.nodes[f"{NODE_PREFIX}convolution{suffix}"]["input"][1]] for suffix in suffixes]
            biases = [self.weights[self.nodes[f"{NODE_PREFIX}Add{suffix}"]["input"][1]] for suffix in suffixes]
        except KeyError as error:
            raise ConversionError(f"The graph model lacks {error}.") from error
        return [
            (torch.from_numpy(kernel).permute(3, 2, 0, 1).contiguous(), torch.from_numpy(bias))
            for kernel, bias in zip(kernels, biases)
        ]

    @torch.no_grad()
    def run(self, image: Tensor, wanted: Tuple[str, ...]) -> List[Tensor]:
        """Outputs of nodes for one 3 x H x W input, each node computed as the graph says."""
        known: Dict[str, Any] = {"input_1": image[None]}

        def value(name: str) -> Any:
            if name in self.weights:
                return self.weights[name]
            if name not in known:
                node = self.nodes[name]
                known[name] = evaluate(node, [value(source) for source in node["input"]])
            return known[name]

        return [value(name) for name in wanted]


def read_weights(manifest: List[dict], folder: Path) -> Dict[str, np.ndarray]:
    """All constants of a model: 32-bit numbers, or such stored as 16-bit floats."""
    weights = {}
    for group in manifest:
        content, offset = b"".join((folder / path).read_bytes() for path in group["paths"]), 0
        for entry in group["weights"]:
            stored = np.dtype(entry.get("quantization", {}).get("dtype", entry["dtype"]))
            count = int(np.prod(entry["shape"], dtype=int))
            table = np.frombuffer(content, stored, count, offset).astype(entry["dtype"])
            weights[entry["name"]] = table.reshape(entry["shape"])
            offset += count * stored.itemsize
    return weights


def evaluate(node: dict, inputs: List[Any]) -> Tensor:
    """One node's output; tensors are laid out as in the graph, where convolutions have their channels last."""
    kind, attributes = node["op"], node.get("attr", {})
    if kind == "Transpose":
        return inputs[0].permute(*inputs[1].tolist())
    if kind in ("Pad", "PadV2"):
        amounts = [int(amount) for pair in inputs[1][::-1] for amount in pair]
        return F.pad(inputs[0], amounts, value=max(float(inputs[2]), -1e30) if len(inputs) > 2 else 0.0)
    if kind == "Add":
        return inputs[0] + torch.from_numpy(inputs[1])
    if kind == "LeakyRelu":
        return F.leaky_relu(inputs[0], attributes["alpha"]["f"])
    if kind == "ConcatV2":
        return torch.cat(inputs[:-1], dim=int(inputs[-1]))
    if kind in ("Conv2D", "MaxPool") and base64.b64decode(attributes["padding"]["s"]) == b"VALID":
        stride = [int(step) for step in attributes["strides"]["list"]["i"]][1:3]
        channels_first = inputs[0].permute(0, 3, 1, 2)
        if kind == "MaxPool":
            size = [int(length) for length in attributes["ksize"]["list"]["i"]][1:3]
            return F.max_pool2d(channels_first, size, stride).permute(0, 2, 3, 1)
        return F.conv2d(channels_first, torch.from_numpy(inputs[1]).permute(3, 2, 0, 1), stride=stride).permute(0, 2, 3, 1)
    raise ConversionError(f"The graph model has a node {node['name']} of a kind that is not expected: {kind}.")


def for_our_input(weight: Tensor, bias: Tensor) -> Tuple[Tensor, Tensor]:
    """The first convolution changed from NanoDet's input to ours: red first, one mean and deviation for all channels."""
    mean, std = torch.tensor(MEAN_BGR).flip(0), torch.tensor(STD_BGR).flip(0)
    weight = weight.flip(1)
    bias = bias + (weight.sum(dim=(2, 3)) * (MEAN - mean) / std).sum(dim=1)
    return weight * (STD / std)[None, :, None, None], bias


def blocks_of(backbone: nn.Module) -> List[ConvBlock]:
    """The normalised convolutions of a backbone (of any module) in their order of execution."""
    return [module for module in backbone.modules() if isinstance(module, ConvBlock)]


@torch.no_grad()
def put_into(backbone: nn.Module, convolutions: List[Tuple[Tensor, Tensor]]) -> None:
    """Weights and biases into the backbone; its normalisation then adds the bias and does nothing else."""
    for block, (weight, bias) in zip(blocks_of(backbone), convolutions):
        if block[0].weight.shape != weight.shape:
            raise ConversionError(f"A convolution has the shape {tuple(weight.shape)}, not {tuple(block[0].weight.shape)}.")
        block[0].weight.copy_(weight)
        block[1].running_mean.zero_()
        block[1].running_var.fill_(1 - block[1].eps)
        block[1].weight.fill_(1)
        block[1].bias.copy_(bias)


@torch.no_grad()
def fold_normalisation(network: nn.Module) -> None:
    """Every block's normalisation into its convolution: it then adds the bias and does nothing else. In place, for inference."""
    for module in network.modules():
        if isinstance(module, ConvBlock):
            fused = fuse_conv_bn_eval(module[0], module[1])
            put_into(module, [(fused.weight, fused.bias)])


@torch.no_grad()
def unfold_normalisation(backbone: nn.Module, images: Tensor) -> None:
    """Scale every convolution to outputs of variance 1 on `images` (B x 3 x H x W), undone by its normalisation.

    What the backbone computes stays the same, and training, which normalises by batches, starts from there.
    """
    moments = {}

    def measure(block: ConvBlock, inputs: Tuple[Tensor]) -> None:
        deviations, means = torch.std_mean(block[0](inputs[0]), dim=(0, 2, 3))
        moments[block] = deviations.clamp(min=LEAST_DEVIATION), means

    hooks = [block.register_forward_pre_hook(measure) for block in blocks_of(backbone)]
    backbone.eval()(images)
    for hook in hooks:
        hook.remove()
    for block, (deviations, means) in moments.items():
        norm = block[1]
        slope = norm.weight / torch.sqrt(norm.running_var + norm.eps)
        offset = norm.bias - slope * norm.running_mean
        block[0].weight.div_(deviations[:, None, None, None])
        norm.running_mean.copy_(means / deviations)
        norm.running_var.fill_(1 - norm.eps)
        norm.weight.copy_(slope * deviations)
        norm.bias.copy_(offset + slope * means)


def load_backbone(backbone: nn.Module, path: Path, images: Tensor) -> None:
    """Put the converted weights of `path` into a backbone, normalisation calibrated on `images`."""
    try:
        convolutions = torch.load(path, map_location="cpu")["convolutions"]
    except (OSError, KeyError, RuntimeError) as error:
        raise ConversionError(f"Cannot read the backbone {path}: {error}.") from error
    if len(convolutions) < len(blocks_of(backbone)):
        raise ConversionError(f"{path} holds {len(convolutions)} convolutions, fewer than {len(blocks_of(backbone))}.")
    put_into(backbone, convolutions)
    unfold_normalisation(backbone, images)


@torch.no_grad()
def load_exported(detector: Detector, path: Path, images: Optional[Tensor] = None) -> int:
    """Begin with the weights of an exported detector (onnx_model.py), normalisation calibrated on `images`, if any: to train on.

    Layers of another shape keep theirs, so that a network of another size takes over what it shares; of scores those of the
    classes that it has go into the first of ours. Returns how many convolutions were taken over as a whole.
    """
    try:
        stored = {entry.name: torch.from_numpy(numpy_helper.to_array(entry).copy()) for entry in onnx.load_from_string(model_bytes(path)).graph.initializer}
    except Exception as error:  # python3-onnx passes on what protobuf throws.
        raise ConversionError(f"Cannot read the exported detector {path}: {error}.") from error
    taken = 0
    for name, module in detector.named_modules():
        if isinstance(module, ConvBlock):
            weight, bias = (stored.get(f"detector.{name}.0.{part}") for part in ("weight", "bias"))
            if weight is not None and bias is not None and weight.shape == module[0].weight.shape:
                put_into(module, [(weight, bias)])
                taken += 1
    for level, head in enumerate(detector.heads):
        for part, layer, skipped in (("box", head.box[-1], 0), ("score", head.score[-1], 1)):  # objectness comes first
            weight, bias = (stored.get(f"detector.heads.{level}.{part}.1.{kind}") for kind in ("weight", "bias"))
            if weight is not None and bias is not None and weight.shape[1:] == layer.weight.shape[1:]:
                shared = min(len(weight) - skipped, len(layer.weight))
                layer.weight[:shared].copy_(weight[skipped : skipped + shared])
                layer.bias[:shared].copy_(bias[skipped : skipped + shared])
                taken += len(weight) - skipped == len(layer.weight)
    if not taken:
        raise ConversionError(f"{path} is no exported detector of such a network.")
    if images is not None:
        unfold_normalisation(detector, images)
    return taken
