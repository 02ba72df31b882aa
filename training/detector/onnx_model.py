"""The network as one ONNX graph that OpenCV 4.6 loads, and running it there."""

import copy
import warnings
from pathlib import Path
from typing import Sequence, Tuple

import cv2
import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.fusion import fuse_conv_bn_eval

from .inference import ViewConfig
from .network import ConvBlock, Detector
from .packing import model_bytes
from .validation import ForwardFunction

CERTAIN = 30.0
"""A logit whose sigmoid is exactly 1 in float32: the objectness of every anchor point."""


class ExportableDetector(nn.Module):
    """1 x 3 x H x W to 1 x N x (5 + C) in YOLOX's layout: tx, ty, tw, th, objectness, class scores.

    The detector has no objectness of its own. Decoders multiply it with the class score, so it is
    exported as 1: a channel with zero weights and a large bias, which needs no constant in the graph.
    """

    def __init__(self, detector: Detector, scales: Sequence[float] = (1.0,)):
        super().__init__()
        self.scales = tuple(scales)
        detector = copy.deepcopy(detector).cpu().eval()
        fuse_batch_norms(detector)
        self.detector = detector
        for head in detector.heads:
            head.score[-1] = with_certain_objectness(head.score[-1])

    def forward(self, images: Tensor) -> Tensor:
        views = [self.view(self.scaled(images, scale)) for scale in self.scales]
        return torch.cat(views, dim=2).permute(0, 2, 1)

    @staticmethod
    def scaled(images: Tensor, scale: float) -> Tensor:
        """As resizing the picture would: the middle of a pixel stays where it is."""
        if scale == 1:
            return images
        return F.interpolate(images, scale_factor=scale, mode="bilinear", align_corners=False, recompute_scale_factor=False)

    def view(self, images: Tensor) -> Tensor:
        """1 x (5 + C) x N of the network at one scale."""
        levels = self.detector.pyramid(self.detector.backbone(images))
        outputs = []
        for head, level in zip(self.detector.heads, levels):
            rows = torch.cat([head.box(level), head.score(level).sigmoid()], dim=1)
            outputs.append(rows.reshape(1, 5 + self.detector.class_count, -1))
        return torch.cat(outputs, dim=2)


def fuse_batch_norms(module: nn.Module) -> None:
    """Fold every ConvBlock's batch normalisation into its convolution, in place."""
    for child in module.modules():
        if isinstance(child, ConvBlock):
            child[0], child[1] = fuse_conv_bn_eval(child[0], child[1]), nn.Identity()


def with_certain_objectness(scores: nn.Conv2d) -> nn.Conv2d:
    """A 1x1 convolution with one more output in front that is always CERTAIN."""
    extended = nn.Conv2d(scores.in_channels, scores.out_channels + 1, 1)
    with torch.no_grad():
        extended.weight.copy_(torch.cat([torch.zeros_like(scores.weight[:1]), scores.weight]))
        extended.bias.copy_(torch.cat([torch.full_like(scores.bias[:1], CERTAIN), scores.bias]))
    return extended


def export(detector: Detector, path: Path, view: ViewConfig = ViewConfig()) -> ExportableDetector:
    """Write the graph; returns the module that it was traced from."""
    exportable = ExportableDetector(detector, view.scales)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", torch.jit.TracerWarning)  # sizes are compared while tracing: the graph's are fixed
        torch.onnx.export(
            exportable, torch.zeros(1, 3, view.height, view.width), str(path), opset_version=11,
            input_names=["images"], output_names=["predictions"],
        )
    onnx.save(for_opencv(onnx.load(str(path))), str(path))
    return exportable


def for_opencv(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same graph with constants as initializers and without nodes that only pass a tensor on.

    torch 1.13 shares equal weights through Identity nodes on initializers, which OpenCV 4.6 refuses.
    """
    graph, renamed, kept = model.graph, {}, []
    outputs = {output.name for output in graph.output}
    for node in graph.node:
        node.input[:] = [renamed.get(name, name) for name in node.input]
        if node.op_type == "Identity" and node.output[0] not in outputs:
            renamed[node.output[0]] = node.input[0]
        elif node.op_type == "Constant" and node.attribute[0].name == "value":
            value = numpy_helper.to_array(node.attribute[0].t)
            graph.initializer.append(numpy_helper.from_array(value, node.output[0]))
        else:
            kept.append(node)
    del graph.node[:]
    graph.node.extend(kept)
    return model


def opencv_network(path: Path) -> cv2.dnn.Net:
    """A graph, packed or not, as OpenCV loads it."""
    return cv2.dnn.readNetFromONNX(np.frombuffer(model_bytes(path), np.uint8))


def opencv_outputs(path: Path, images: np.ndarray) -> np.ndarray:
    """Predictions (1 x N x (5 + C)) of OpenCV for a 1 x 3 x H x W float32 input."""
    network = opencv_network(path)
    network.setInput(images)
    return network.forward("predictions")


def opencv_forward(path: Path) -> ForwardFunction:
    """A runner as validation uses it, on OpenCV's own backend."""
    network = opencv_network(path)

    def run(image: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        network.setInput(image[None])
        predictions = network.forward("predictions")[0]
        return predictions[:, :4], predictions[:, 4:5] * predictions[:, 5:]

    return run


def golden_image(width: int, height: int) -> np.ndarray:
    """H x W x 3 uint8: (x (c + 1) + 2 y + x y / 64) mod 256, integer division, c = 0 for red."""
    y, x, channel = np.mgrid[:height, :width, :3]
    return ((x * (channel + 1) + 2 * y + x * y // 64) % 256).astype(np.uint8)
