"""The classifier: the backbone of the detector's network at half the survey's resolution, and a small head of its own.

Early discard by transfer (Wang et al. 2018): features that others learnt from far more pictures than we have, kept as
they are, and a few depthwise separable convolutions (MobileNet) on top, which give a map of "hazard here". The frame's
score is the highest of the map, so one near hazard is enough, whatever else the frame shows. The map is what makes few
labels enough: a box says where in the frame the reason to send lies.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import List

import cv2
import numpy as np
import onnx
import torch
from onnx import compose
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.fusion import fuse_conv_bn_eval

from detector.inference import letterbox, normalise

from . import INPUT_HEIGHT, INPUT_WIDTH

STRIDE = 8
"""Pixels of the input per cell of the fine features and of the map."""


@dataclass(frozen=True)
class Level:
    """A tensor of the detector's graph that the head begins with."""

    name: str
    stride: int
    channels: int

    def shape(self) -> List[int]:
        """Of the tensor, for our input."""
        return [1, self.channels, INPUT_HEIGHT // self.stride, INPUT_WIDTH // self.stride]


FINE, COARSE = Level("/backbone/stride8/Concat_output_0", STRIDE, 128), Level("/backbone/stride16/Concat_output_0", 2 * STRIDE, 256)
LEVELS = (FINE, COARSE)

PRIOR_PROBABILITY = 0.02
"""Score of every cell before training."""


class NetworkError(Exception):
    """A detector's file is not what the classifier can begin with; the text is one sentence for the user."""


def cut_backbone(detector: Path, out: Path) -> None:
    """Write the detector's backbone as a graph of its own, for our input size, to `out`."""
    try:
        model = onnx.load(str(detector))
    except Exception as error:  # python3-onnx passes on what protobuf throws.
        raise NetworkError(f"Cannot read the detector {detector}: {error}.") from error
    by_output = {node.output[0]: node for node in model.graph.node}
    for level in LEVELS:
        if level.name not in by_output or [value.name for value in model.graph.input] != ["images"]:
            raise NetworkError(f"The detector {detector} has no tensor {level.name}.")
    wanted, open_names = set(), [level.name for level in LEVELS]
    while open_names:
        name = open_names.pop()
        if name in by_output and name not in wanted:
            wanted.add(name)
            open_names += by_output[name].input
    nodes = [node for node in model.graph.node if node.output[0] in wanted]
    used = {name for node in nodes for name in node.input}
    shapes = [("images", [1, 3, INPUT_HEIGHT, INPUT_WIDTH])] + [(level.name, level.shape()) for level in LEVELS]
    images, *features = (onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape) for name, shape in shapes)
    weights = [weight for weight in model.graph.initializer if weight.name in used]
    graph = onnx.helper.make_graph(nodes, "backbone", [images], features, weights)
    onnx.save(made(graph, model), str(out))


def made(graph: onnx.GraphProto, like: onnx.ModelProto) -> onnx.ModelProto:
    """A model of `graph` of the same versions as `like`, checked."""
    model = onnx.helper.make_model(graph, producer_name="livemap", opset_imports=like.opset_import)
    model.ir_version = like.ir_version
    onnx.checker.check_model(model)
    return model


class Features:
    """The backbone, run by OpenCV."""

    def __init__(self, backbone: Path):
        self.network = cv2.dnn.readNetFromONNX(str(backbone))

    def of(self, image: np.ndarray) -> List[np.ndarray]:
        """Per level C x H x W float32 of an H x W x 3 uint8 picture, RGB, not larger than the input."""
        self.network.setInput(normalise(letterbox(image, INPUT_WIDTH, INPUT_HEIGHT)[0])[None])
        return [found[0].copy() for found in self.network.forward([level.name for level in LEVELS])]


class Block(nn.Sequential):
    """Convolution, batch normalisation, ReLU."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int, stride: int = 1, groups: int = 1):
        super().__init__(
            nn.Conv2d(channels_in, channels_out, kernel, stride, kernel // 2, groups=groups, bias=False),
            nn.BatchNorm2d(channels_out, momentum=0.03),
            nn.ReLU(inplace=True),
        )


class Separable(nn.Sequential):
    """A depthwise 3x3 and a pointwise convolution (Howard et al. 2017)."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1):
        super().__init__(Block(channels_in, channels_in, 3, stride, groups=channels_in), Block(channels_in, channels_out, 1))


class Head(nn.Module):
    """B x 128 x H x W features and B x 256 x H/2 x W/2 ones to a map of logits, B x 1 x H x W; H and W are even."""

    def __init__(self, wide: int = 64, context: int = 128):
        super().__init__()
        self.drop = nn.Dropout2d(0.1)
        self.near = Block(FINE.channels, wide, 1)
        self.far = Separable(FINE.channels, context, stride=2)
        self.coarse = Block(COARSE.channels, context, 1)
        self.around = nn.Sequential(Separable(context, context), Block(context, wide, 1))
        self.out = nn.Sequential(Separable(wide, wide), Separable(wide, wide), nn.Conv2d(wide, 1, 1))
        nn.init.constant_(self.out[-1].bias, torch.logit(torch.tensor(PRIOR_PROBABILITY)).item())

    def forward(self, fine: Tensor, coarse: Tensor) -> Tensor:
        fine, coarse = self.drop(fine), self.drop(coarse)
        around = F.interpolate(self.around(self.far(fine) + self.coarse(coarse)), scale_factor=2.0, mode="nearest")
        return self.out(self.near(fine) + around)


class ExportableHead(nn.Module):
    """Features as the head takes them, of one picture, to 1 x 1: the probability that the frame is worth sending."""

    def __init__(self, head: Head):
        super().__init__()
        self.head = head.cpu().eval()
        self.head.drop = nn.Identity()
        for child in self.head.modules():
            if isinstance(child, Block):
                child[0], child[1] = fuse_conv_bn_eval(child[0], child[1]), nn.Identity()

    def forward(self, fine: Tensor, coarse: Tensor) -> Tensor:
        whole = (INPUT_HEIGHT // STRIDE, INPUT_WIDTH // STRIDE)
        return F.max_pool2d(self.head(fine, coarse), whole).flatten(1).sigmoid()


def export(head: Head, backbone: Path, out: Path) -> ExportableHead:
    """Write backbone and head as one graph; returns the head that it was traced from."""
    exportable = ExportableHead(head)
    features, names = tuple(torch.zeros(level.shape()) for level in LEVELS), ["fine", "coarse"]
    torch.onnx.export(exportable, features, str(out), opset_version=11, input_names=names, output_names=["score"])
    first, second = onnx.load(str(backbone)), onnx.load(str(out))
    # Both graphs must be of the same versions to be merged; both were written for opset 11.
    second.ir_version = first.ir_version
    second = compose.add_prefix(second, "head")
    merged = compose.merge_models(first, second, io_map=[(level.name, f"head{name}") for level, name in zip(LEVELS, names)], outputs=["headscore"])
    for node in merged.graph.node:
        node.output[:] = ["score" if name == "headscore" else name for name in node.output]
    merged.graph.output[0].name = "score"
    onnx.save(made(merged.graph, first), str(out))
    return exportable
