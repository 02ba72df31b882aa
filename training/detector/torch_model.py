"""An exported ONNX network as a TorchScript file, which libtorch runs.

The network is rebuilt from the ONNX file alone, so that both files hold the same weights and a TorchScript file can
be made for a model whose checkpoint is gone. Only the operators that the exports here use are known; another one is
refused by name.
"""

import io
import warnings
from pathlib import Path
from typing import Callable, Dict, List

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import Tensor, nn
from torch.nn import functional as F

from .packing import model_bytes


class UnknownOperator(Exception):
    """The ONNX file asks for something that is not known here; the text is one sentence for the user."""


def symmetric(node: onnx.NodeProto, attributes: Dict) -> List[int]:
    """The padding of a convolution or a pooling, (rows, columns); torch pads both sides alike."""
    pads = list(attributes.get("pads", [0, 0, 0, 0]))
    if pads[:2] != pads[2:] or attributes.get("auto_pad", b"NOTSET") != b"NOTSET" or attributes.get("ceil_mode", 0):
        raise UnknownOperator(f"{node.op_type} '{node.name}' pads its sides differently or rounds up.")
    return pads[:2]


def convolution(node: onnx.NodeProto, attributes: Dict) -> Callable:
    padding = symmetric(node, attributes)

    def run(images: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        return F.conv2d(images, weight, bias, attributes.get("strides", [1, 1]), padding,
                        attributes.get("dilations", [1, 1]), attributes.get("group", 1))

    return run


def pooling(node: onnx.NodeProto, attributes: Dict, pool: Callable) -> Callable:
    padding = symmetric(node, attributes)
    return lambda images: pool(images, attributes["kernel_shape"], attributes.get("strides", [1, 1]), padding)


def enlargement(node: onnx.NodeProto, attributes: Dict) -> Callable:
    """Nearest-neighbour upsampling by whole factors, or linear interpolation; the second input, the region of interest, is not used."""
    linear = attributes.get("mode") == b"linear" and attributes.get("coordinate_transformation_mode") in (b"half_pixel", b"pytorch_half_pixel")
    nearest = attributes.get("mode") == b"nearest" and attributes.get("nearest_mode", b"") in (b"floor", b"")
    if not linear and not nearest:
        raise UnknownOperator(f"Resize '{node.name}' is neither of the nearest neighbour, rounded down, nor linear between pixels' middles.")

    def run(images: Tensor, _: Tensor, scales: Tensor) -> Tensor:
        factors = [float(scale) for scale in scales[2:]]
        if nearest:
            return F.interpolate(images, scale_factor=factors, mode="nearest")
        return F.interpolate(images, scale_factor=factors, mode="bilinear", align_corners=False, recompute_scale_factor=False)

    return run


def cut(tensor: Tensor, starts: Tensor, ends: Tensor, axes: Tensor, steps: Tensor) -> Tensor:
    """Some rows of some axes."""
    if any(step != 1 for step in steps.tolist()):
        raise UnknownOperator("A Slice takes steps.")
    for start, end, axis in zip(starts.tolist(), ends.tolist(), axes.tolist()):
        tensor = tensor.narrow(axis, start, min(end, tensor.shape[axis]) - start)
    return tensor


OPERATORS: Dict[str, Callable[[onnx.NodeProto, Dict], Callable]] = {
    "AveragePool": lambda node, attributes: pooling(node, attributes, F.avg_pool2d),
    "Concat": lambda _, attributes: lambda *tensors: torch.cat(tensors, dim=attributes["axis"]),
    "Conv": convolution,
    "Constant": lambda _, attributes: lambda: torch.from_numpy(numpy_helper.to_array(attributes["value"]).copy()),
    "LeakyRelu": lambda _, attributes: lambda tensor: F.leaky_relu(tensor, attributes.get("alpha", 0.01)),
    "MaxPool": lambda node, attributes: pooling(node, attributes, F.max_pool2d),
    "Relu": lambda *_: F.relu,
    "Reshape": lambda *_: lambda tensor, shape: tensor.reshape([int(size) for size in shape]),
    "Resize": enlargement,
    "Sigmoid": lambda *_: torch.sigmoid,
    "Slice": lambda *_: cut,
    "Transpose": lambda _, attributes: lambda tensor: tensor.permute(attributes["perm"]),
}


class OnnxNetwork(nn.Module):
    """The graph of an ONNX file of one input and one output, run node by node; made to be traced."""

    def __init__(self, model: onnx.ModelProto):
        super().__init__()
        graph = model.graph
        self.constants = {tensor.name: torch.from_numpy(numpy_helper.to_array(tensor).copy())
                          for tensor in graph.initializer}
        inputs = [value for value in graph.input if value.name not in self.constants]
        if len(inputs) != 1 or len(graph.output) != 1:
            raise UnknownOperator(f"The network has {len(inputs)} inputs and {len(graph.output)} outputs, known is one of each.")
        self.input_name, self.output_name = inputs[0].name, graph.output[0].name
        self.input_shape = [size.dim_value for size in inputs[0].type.tensor_type.shape.dim]
        self.steps = []
        for node in graph.node:
            if node.op_type not in OPERATORS or len(node.output) != 1:
                raise UnknownOperator(f"The operator {node.op_type} is not known, known are {', '.join(sorted(OPERATORS))}.")
            attributes = {entry.name: helper.get_attribute_value(entry) for entry in node.attribute}
            self.steps.append((OPERATORS[node.op_type](node, attributes), list(node.input), node.output[0]))

    def forward(self, images: Tensor) -> Tensor:
        values = {**self.constants, self.input_name: images}
        for operator, inputs, output in self.steps:
            values[output] = operator(*(values[name] if name else torch.empty(0) for name in inputs))
        return values[self.output_name]


def export_torch(weights: Path, path: Path) -> OnnxNetwork:
    """Write the network of the ONNX file `weights` as TorchScript; returns the network that was traced."""
    network = OnnxNetwork(onnx.load_from_string(model_bytes(weights))).eval()
    with torch.no_grad(), warnings.catch_warnings():
        # Shapes and scales are constants of the graph: that the trace keeps them is what is wanted.
        warnings.simplefilter("ignore", torch.jit.TracerWarning)
        traced = torch.jit.trace(network, torch.zeros(network.input_shape), check_trace=False)
        frozen = torch.jit.freeze(traced.eval())
    buffer = io.BytesIO()
    torch.jit.save(frozen, buffer)
    path.write_bytes(without_sources(buffer.getvalue()))
    return network


def without_sources(archive: bytes) -> bytes:
    """A TorchScript file without its records of who called whom, which name paths of the machine that made it."""
    reader, kept = torch._C.PyTorchFileReader(io.BytesIO(archive)), io.BytesIO()
    writer = torch._C.PyTorchFileWriter(kept)
    for name in reader.get_all_records():
        # The writer adds the version itself.
        if not name.endswith(".debug_pkl") and name != "version":
            record = reader.get_record(name)
            writer.write_record(name, record, len(record))
    writer.write_end_of_file()
    return kept.getvalue()


def torch_outputs(path: Path, images: np.ndarray) -> np.ndarray:
    """Predictions (1 x N x (5 + C)) of torch for a 1 x 3 x H x W float32 input."""
    with torch.no_grad():
        return torch.jit.load(io.BytesIO(model_bytes(path)))(torch.from_numpy(images)).numpy()
