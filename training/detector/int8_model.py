"""An exported ONNX network in whole numbers of 8 bits, as a TorchScript file for libtorch's oneDNN engine.

Static quantisation after training: weights per output channel, activations per tensor, by what pictures of the training
data make of them. The network is rebuilt from the ONNX file, node by node, as torch_model.py does it. What follows a
sigmoid or reorders rows stays float32.

Pixels are their own quantised values (scale 1 / std, zero point mean), so neither the program nor the network scales
them. The file has a method for each view, `view_0` and on, from uint8 pixels (1 x 3 x height x width of that view) to its
rows (1 x N x (5 + C)) of float32: a view is resized by who calls, and each can be looked at alone.
"""

import io
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Dict, Iterable, List, Optional, Sequence, Set, Tuple

import cv2
import numpy as np
import onnx
import torch
from onnx import helper
from torch import Tensor, nn
from torch.ao.nn import quantized
from torch.nn.intrinsic import quantized as fused

from .inference import MEAN, STD, ViewConfig
from .manifest import Manifest, ManifestError
from .onnx_model import opencv_forward
from .packing import model_bytes
from .torch_model import OnnxNetwork, UnknownOperator, without_sources
from .validation import ForwardFunction

ENGINE = "onednn"
"""The library behind torch's quantised operators: it has kernels for processors with VNNI."""

OBSERVED = 1 << 11
"""Numbers of one activation in one picture, beside its extremes, that its range is taken from."""

SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.4)
"""Of an activation's extremes, what its range may end at."""

LEAST_LOGIT, MOST_LOGIT = -5.0, 7.0
"""Of a score before its sigmoid, what is told apart: below 0.007 nothing is ever reported, above 0.999 nothing is surer."""

SAME_RANGE = ("AveragePool", "MaxPool", "Resize", "Slice", "Concat")
"""Operators that only move, choose or mix numbers: what goes in and what comes out share one scale."""

FLOAT_ONLY = ("Sigmoid", "Reshape", "Transpose")

Range = Tuple[float, int]
"""Scale and zero point of an activation."""


class Groups:
    """Names that share something (a union-find)."""

    def __init__(self):
        self.parents: Dict[str, str] = {}

    def find(self, name: str) -> str:
        """The name that stands for the group."""
        while self.parents.get(name, name) != name:
            name = self.parents[name]
        return name

    def join(self, one: str, other: str) -> None:
        """Makes two groups one."""
        self.parents[self.find(one)] = self.find(other)


@dataclass
class View:
    """The part of a graph that looks at the picture at one scale."""

    scale: float
    source: str  # name of what holds the picture at that scale
    parts: List[str]  # names of the outputs, joined along `axis` after `order`
    axis: int
    order: Optional[List[int]]
    nodes: Set[int] = field(default_factory=set)  # indices in the graph


def attributes_of(node: onnx.NodeProto) -> Dict:
    """Attributes by name."""
    return {entry.name: helper.get_attribute_value(entry) for entry in node.attribute}


class Graph:
    """An ONNX graph as its operators, with what asks for what."""

    def __init__(self, weights: Path):
        model = onnx.load_from_string(model_bytes(weights))
        self.network = OnnxNetwork(model).eval()
        self.nodes = list(model.graph.node)
        self.constants = self.network.constants
        self.producer = {node.output[0]: index for index, node in enumerate(self.nodes)}
        self.consumers: Dict[str, List[onnx.NodeProto]] = {}
        for node in self.nodes:
            for name in self.activations(node):
                self.consumers.setdefault(name, []).append(node)

    def activations(self, node: onnx.NodeProto) -> List[str]:
        """What a node computes with, apart from constants."""
        return [name for name in node.input if name and name not in self.constants]

    def views(self, count: int) -> List[View]:
        """The graph cut into its views: the last Concat has as many parts of each."""
        name, order = self.network.output_name, None
        last = self.nodes[self.producer[name]]
        if last.op_type == "Transpose" and last.input[0] in self.producer:
            order, last = list(attributes_of(last)["perm"]), self.nodes[self.producer[last.input[0]]]
        if last.op_type != "Concat" or len(last.input) % count:
            raise UnknownOperator(f"The output is no Concat of the parts of {count} views.")
        axis, each = attributes_of(last)["axis"], len(last.input) // count
        axis = order.index(axis) if order else axis
        return [self.view(list(last.input[first : first + each]), axis, order) for first in range(0, len(last.input), each)]

    def view(self, parts: List[str], axis: int, order: Optional[List[int]]) -> View:
        """What leads from the picture to `parts`."""
        found = View(1.0, self.network.input_name, parts, axis, order)
        wanted = list(parts)
        while wanted:
            index = self.producer.get(wanted.pop())
            if index is None or index in found.nodes:
                continue
            node = self.nodes[index]
            if node.op_type == "Resize" and node.input[0] == self.network.input_name:
                found.scale, found.source = float(self.constants[node.input[2]][-1]), node.output[0]
                continue
            found.nodes.add(index)
            wanted += self.activations(node)
        return found

    def relu_after(self, node: onnx.NodeProto) -> Optional[onnx.NodeProto]:
        """The ReLU that a convolution can do by itself: the only one that wants its output."""
        after = self.consumers.get(node.output[0], [])
        return after[0] if len(after) == 1 and after[0].op_type == "Relu" else None

    def feeds_sigmoid(self, name: str) -> bool:
        """Whether an activation is a score before its sigmoid."""
        return any(node.op_type == "Sigmoid" for node in self.consumers.get(name, []))

    def float_values(self) -> Set[str]:
        """Names of what stays float32."""
        floats: Set[str] = set()
        for node in self.nodes:
            if node.op_type in FLOAT_ONLY or any(name in floats for name in self.activations(node)):
                floats.add(node.output[0])
        return floats

    def shared_ranges(self, floats: Set[str]) -> Groups:
        """Activations of one scale: those that are only moved."""
        groups = Groups()
        for node in self.nodes:
            if node.op_type in SAME_RANGE and node.output[0] not in floats:
                for name in self.activations(node):
                    groups.join(name, node.output[0])
        return groups

    def constant_channels(self, node: onnx.NodeProto) -> Tensor:
        """Outputs of a convolution that hang on nothing, such as a certain objectness."""
        return self.constants[node.input[1]].flatten(1).abs().amax(dim=1) == 0


def range_of(values: np.ndarray) -> Range:
    """The scale and zero point that change the values least (mean squared error): clipping a few may serve the rest."""
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 1e-6)
    best = (np.inf, 1.0, 0)
    for share in SHARES:
        for least, most in {(low * share, high * share), (low, high * share), (low * share, high)}:
            scale = (most - least) / 255
            zero = int(np.clip(round(-least / scale), 0, 255))
            rounded = (np.clip(np.rint(values / scale) + zero, 0, 255) - zero) * scale
            best = min(best, (float(np.square(rounded - values).mean()), scale, zero))
    return best[1:]


def observe(graph: Graph, floats: Set[str], inputs: Iterable[np.ndarray]) -> Dict[str, Range]:
    """The range of every activation, by what the float network makes of `inputs` (1 x 3 x H x W, normalised)."""
    groups, network = graph.shared_ranges(floats), graph.network
    seen: Dict[str, List[np.ndarray]] = {}
    names = {node.output[0] for node in graph.nodes} - floats
    constant = {node.output[0]: graph.constant_channels(node) for node in graph.nodes if node.op_type == "Conv"}
    for images in inputs:
        values = {**network.constants, network.input_name: torch.from_numpy(images)}
        for operator, sources, output in network.steps:
            values[output] = operator(*(values[name] if name else torch.empty(0) for name in sources))
            if output not in names:
                continue
            found = values[output][:, ~constant[output]] if output in constant else values[output]
            if graph.feeds_sigmoid(output):
                found = found.clamp(LEAST_LOGIT, MOST_LOGIT)
            found = found.flatten()
            step = -(-found.numel() // OBSERVED) | 1
            seen.setdefault(groups.find(output), []).append(np.append(found[::step].numpy(), [found.min(), found.max()]))
    if not seen:
        raise UnknownOperator("There is no picture to calibrate on.")
    found = {group: range_of(np.concatenate(parts).astype(np.float32)) for group, parts in seen.items()}
    return {name: found[groups.find(name)] for name in names}


def quantised_convolution(graph: Graph, node: onnx.NodeProto, output: Range) -> nn.Module:
    """The node with weights in 8 bits, a scale for each output."""
    attributes = attributes_of(node)
    weight = graph.constants[node.input[1]].clone()
    bias = graph.constants[node.input[2]] if len(node.input) > 2 else torch.zeros(len(weight))
    constant = graph.constant_channels(node)
    scales = (weight.flatten(1).abs().amax(dim=1) / 127).masked_fill(constant, 1.0).double()
    kind = fused.ConvReLU2d if graph.relu_after(node) else quantized.Conv2d
    groups = attributes.get("group", 1)
    module = kind(
        weight.shape[1] * groups, weight.shape[0], tuple(weight.shape[2:]), tuple(attributes.get("strides", [1, 1])),
        tuple(attributes.get("pads", [0, 0])[:2]), tuple(attributes.get("dilations", [1, 1])), groups)
    zeros = torch.zeros(len(scales), dtype=torch.long)
    module.set_weight_bias(torch.quantize_per_channel(weight, scales, zeros, 0, torch.qint8), bias.masked_fill(constant, 0.0))
    module.scale, module.zero_point = output
    return module


class Int8View(nn.Module):
    """One view of the graph with quantised convolutions, run node by node; made to be traced."""

    def __init__(self, graph: Graph, view: View, ranges: Dict[str, Range], floats: Set[str], pixels: Range):
        super().__init__()
        self.graph, self.view, self.ranges, self.floats, self.pixels = [graph], view, ranges, floats, pixels
        self.convolutions = nn.ModuleDict()
        for index in sorted(view.nodes):
            node = graph.nodes[index]
            if node.op_type == "Conv":
                output = (graph.relu_after(node) or node).output[0]
                self.convolutions[str(index)] = quantised_convolution(graph, node, ranges[output])
            if node.output[0] not in floats and any(name in floats for name in graph.activations(node)):
                raise UnknownOperator(f"The {node.op_type} '{node.name}' follows what stays float32.")
        self.offsets = {index: self.offset_of(graph, graph.nodes[index]) for index in view.nodes if graph.nodes[index].op_type == "Conv"}

    def offset_of(self, graph: Graph, node: onnx.NodeProto) -> Tensor:
        """What is added to a convolution's scaled output; channels that hang on nothing are their bias exactly."""
        scale, zero = self.ranges[node.output[0]]
        offset = torch.full((1, len(graph.constants[node.input[1]]), 1, 1), -zero * scale)
        if len(node.input) > 2:  # such a channel's convolution answers 0: its zero point
            constant = graph.constant_channels(node)
            offset[0, constant, 0, 0] += graph.constants[node.input[2]][constant]
        return offset

    def forward(self, pixels: Tensor) -> Tensor:
        graph, view = self.graph[0], self.view
        values: Dict[str, Tensor] = {
            **graph.network.constants, view.source: torch._make_per_tensor_quantized_tensor(pixels, *self.pixels)}
        for index in sorted(view.nodes):
            node, (operator, sources, output) = graph.nodes[index], graph.network.steps[index]
            inputs = [values[name] if name else torch.empty(0) for name in sources]
            if node.op_type == "Conv":
                values[output] = self.convolutions[str(index)](inputs[0])
            elif node.op_type == "Relu" and graph.relu_after(graph.nodes[graph.producer[sources[0]]]) is not None:
                values[output] = inputs[0]  # the convolution has done it
            elif node.op_type == "LeakyRelu":
                slope = attributes_of(node).get("alpha", 0.01)
                values[output] = torch.ops.quantized.leaky_relu(inputs[0], slope, False, *self.ranges[output])
            elif output in self.floats:
                values[output] = operator(*(self.in_float(name, value) for name, value in zip(sources, inputs)))
            else:
                values[output] = operator(*inputs)
        parts = [self.in_float(name, values[name]) for name in view.parts]
        return torch.cat([part.permute(view.order) if view.order else part for part in parts], dim=view.axis)

    def in_float(self, name: str, value: Tensor) -> Tensor:
        """A quantised value as float32."""
        if not value.is_quantized:
            return value
        offset = self.offsets.get(self.graph[0].producer.get(name))
        if offset is None:
            return value.dequantize()
        return value.int_repr().to(torch.float32) * self.ranges[name][0] + offset


class Int8Network(nn.Module):
    """All views; the traced methods are added by name."""

    def __init__(self, views: Sequence[nn.Module]):
        super().__init__()
        self.views = nn.ModuleList(views)


def export_int8(weights: Path, path: Path, pictures: Iterable[np.ndarray], views: int, mean: int, std: float) -> None:
    """Write the network of the ONNX file `weights` in 8 bits; `pictures` (H x W x 3 uint8 of the input's size) calibrate it."""
    torch.backends.quantized.engine = ENGINE
    graph = Graph(weights)
    floats = graph.float_values()
    with torch.no_grad(), warnings.catch_warnings():
        # Shapes and scales are constants of the graph: that the trace keeps them is what is wanted.
        warnings.simplefilter("ignore")
        inputs = (((picture.astype(np.float32) - mean) / std).transpose(2, 0, 1)[None].copy() for picture in pictures)
        ranges = observe(graph, floats, inputs)
        holder, examples = Int8Network([]), {}
        for number, view in enumerate(graph.views(views)):
            holder.views.append(Int8View(graph, view, ranges, floats, (1.0 / std, mean)).eval())
            height, width = (round(side * view.scale) for side in graph.network.input_shape[2:])
            examples[f"view_{number}"] = as_input(np.zeros((height, width, 3), np.uint8))
            setattr(Int8Network, f"view_{number}", lambda self, pixels, number=number: self.views[number](pixels))
        traced = torch.jit.trace_module(holder.eval(), examples, check_trace=False)
        frozen = torch.jit.freeze(traced.eval(), preserved_attrs=list(examples))
    buffer = io.BytesIO()
    torch.jit.save(frozen, buffer)
    path.write_bytes(without_sources(buffer.getvalue()))


def as_input(pixels: np.ndarray) -> Tensor:
    """H x W x 3 uint8 as 1 x 3 x H x W, in memory as it was."""
    return torch.from_numpy(pixels)[None].permute(0, 3, 1, 2)


def int8_outputs(path: Path, scales: Sequence[float]) -> Callable[[np.ndarray], np.ndarray]:
    """A runner of the file: pixels (H x W x 3 uint8 of the input's size) to predictions (1 x N x (5 + C))."""
    torch.backends.quantized.engine = ENGINE
    network = torch.jit.load(io.BytesIO(model_bytes(path)))

    @torch.no_grad()
    def run(pixels: np.ndarray) -> np.ndarray:
        rows = []
        for number, scale in enumerate(scales):
            size = round(pixels.shape[1] * scale), round(pixels.shape[0] * scale)
            view = np.ascontiguousarray(pixels) if scale == 1 else cv2.resize(pixels, size, interpolation=cv2.INTER_LINEAR)
            rows.append(getattr(network, f"view_{number}")(as_input(view)).numpy())
        return np.concatenate(rows, axis=1)

    return run


def int8_forward(path: Path, view: ViewConfig) -> ForwardFunction:
    """A runner as validation uses it."""
    outputs = int8_outputs(path, view.scales)

    def run(image: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        pixels = np.rint(image * STD + MEAN).astype(np.uint8).transpose(1, 2, 0)
        predictions = outputs(np.ascontiguousarray(pixels))[0]
        return predictions[:, :4], predictions[:, 4:5] * predictions[:, 5:]

    return run


def forward_of(manifest: Manifest, precision: str = "") -> ForwardFunction:
    """A runner of a model in the precision that is asked for, else in its manifest's."""
    precision = precision or manifest.precision
    if precision != "int8":
        return opencv_forward(manifest.weights)
    if not manifest.int8:
        raise ManifestError(f"{manifest.weights} has no int8_file: --precision int8 wants one, training/export_int8.py adds it.")
    return int8_forward(manifest.int8, manifest.view)
