"""The network as ONNX graphs that OpenCV 4.6 loads, and running them there.

Three graphs of the same weights: the whole, and its two parts, so that what is known of the map's side is computed once:

    NAME.onnx          first, second, validity -> probabilities
    NAME.encoder.onnx  image -> features_0 ... features_4, finest first
    NAME.head.onnx     first_0 ... first_4, second_0 ... second_4, validity -> probabilities
"""

import copy
import warnings
from pathlib import Path
from typing import Dict, List, Sequence, Tuple

import cv2
import numpy as np
import onnx
import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from detector.onnx_model import for_opencv, golden_image

from .inference import INPUT_HEIGHT, INPUT_WIDTH, normalise
from .blocks import ConvBlock
from .network import Network
from .validation import Detect

OPSET = 13
"""From 13 on softmax over channels is one node; before, OpenCV spends a fifth of its time on transposing for it."""

OUTPUT = "probabilities"
PARTS = ("whole", "encoder", "head")


class Whole(nn.Module):
    """(first, second, validity) to probabilities."""

    def __init__(self, network: Network):
        super().__init__()
        self.network = network

    def forward(self, first: Tensor, second: Tensor, validity: Tensor) -> Tensor:
        return self.network.detect(first, second, validity)


class EncoderPart(nn.Module):
    """A picture to its features."""

    def __init__(self, network: Network):
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> Tuple[Tensor, ...]:
        return tuple(self.network.encode(image))


class HeadPart(nn.Module):
    """Both pictures' features, the first's first, and validity to probabilities."""

    def __init__(self, network: Network):
        super().__init__()
        self.network = network

    def forward(self, *inputs: Tensor) -> Tensor:
        levels = len(inputs) // 2
        return self.network.probabilities(list(inputs[:levels]), list(inputs[levels:-1]), inputs[-1])


def frozen(network: Network) -> Network:
    """A copy for inference, every batch normalisation folded into its convolution."""
    network = copy.deepcopy(network).cpu().eval()
    for module in network.modules():
        if isinstance(module, ConvBlock):
            module[0], module[1] = fuse_conv_bn_eval(module[0], module[1]), nn.Identity()
    return network


def file_of(folder: Path, name: str, part: str) -> Path:
    """Where a part's graph lies."""
    return folder / (f"{name}.onnx" if part == "whole" else f"{name}.{part}.onnx")


def level_names(prefix: str, count: int) -> List[str]:
    """Names of features, finest first."""
    return [f"{prefix}_{level}" for level in range(count)]


def export(network: Network, folder: Path, name: str, parts: Sequence[str] = PARTS) -> Network:
    """Write the graphs; returns the module that they were traced from."""
    network = frozen(network)
    image, validity = torch.zeros(1, 3, INPUT_HEIGHT, INPUT_WIDTH), torch.ones(1, 1, INPUT_HEIGHT, INPUT_WIDTH)
    with torch.no_grad():
        levels = network.encode(image)
    names = {prefix: level_names(prefix, len(levels)) for prefix in ("first", "second", "features")}
    graphs = {
        "whole": (Whole(network), (image, image, validity), ["first", "second", "validity"], [OUTPUT]),
        "encoder": (EncoderPart(network), (image,), ["image"], names["features"]),
        "head": (HeadPart(network), (*levels, *levels, validity), names["first"] + names["second"] + ["validity"], [OUTPUT]),
    }
    for part in parts:
        module, inputs, input_names, output_names = graphs[part]
        path = file_of(folder, name, part)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of shape inference, about graphs that it infers anyway
            torch.onnx.export(
                module.eval(), inputs, str(path), opset_version=OPSET, input_names=input_names, output_names=output_names
            )
        onnx.save(for_opencv(onnx.load(str(path))), str(path))
    return network


class OpenCvModel:
    """One exported graph on OpenCV's own backend."""

    def __init__(self, path: Path):
        self.network = cv2.dnn.readNetFromONNX(str(path))

    def run(self, inputs: Dict[str, np.ndarray], outputs: Sequence[str] = (OUTPUT,)) -> List[np.ndarray]:
        """Outputs by name for float32 inputs by name."""
        for name, value in inputs.items():
            self.network.setInput(np.ascontiguousarray(value, np.float32), name)
        return list(self.network.forward(list(outputs)))

    def output_names(self) -> List[str]:
        """In alphabetical order."""
        return sorted(self.network.getUnconnectedOutLayersNames())


def run_parts(encoder: OpenCvModel, head: OpenCvModel, first: np.ndarray, second: np.ndarray, validity: np.ndarray) -> np.ndarray:
    """What the whole graph would give, from its two parts; inputs with a leading 1."""
    names, inputs = encoder.output_names(), {"validity": validity}
    for prefix, image in (("first", first), ("second", second)):
        features = [np.array(level) for level in encoder.run({"image": image}, names)]
        inputs.update(zip(level_names(prefix, len(names)), features))
    return head.run(inputs)[0]


def golden_inputs() -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and second picture and validity of the golden pair, with a leading 1; the second is the first mirrored."""
    image = golden_image(INPUT_WIDTH, INPUT_HEIGHT)
    validity = np.ones((1, 1, INPUT_HEIGHT, INPUT_WIDTH), np.float32)
    validity[..., :16] = 0
    return normalise(image)[None], normalise(np.ascontiguousarray(image[:, ::-1]))[None], validity


def opencv_detector(path: Path) -> Detect:
    """The whole graph as validation uses it."""
    model = OpenCvModel(path)

    def detect(first: np.ndarray, second: np.ndarray, validity: np.ndarray) -> np.ndarray:
        inputs = {"first": normalise(first)[None], "second": normalise(second)[None], "validity": validity[None, None]}
        return np.array(model.run(inputs)[0][0])

    return detect
