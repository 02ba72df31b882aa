"""Models that would be larger than a repository should hold: weights of half the precision, and gzip.

The 16 upper bits of a float32 (bfloat16, in which the weights are trained anyway) are kept, so that the lower ones are
zeros, which gzip leaves out: half the size, and every runtime still reads plain float32.
"""

import gzip
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper

LEAST_ROUNDED = 1024
"""Tensors of fewer numbers, such as biases, keep all their bits."""


def model_bytes(path: Path) -> bytes:
    """What a weights file holds, unpacked where its name ends in .gz."""
    content = path.read_bytes()
    return gzip.decompress(content) if path.suffix == ".gz" else content


def round_weights(path: Path) -> None:
    """Rounds the large tensors of an ONNX file to bfloat16's precision, in place."""
    model = onnx.load(str(path))
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == "float32" and values.size >= LEAST_ROUNDED:
            rounded = torch.from_numpy(values.copy()).bfloat16().float().numpy()
            tensor.CopyFrom(numpy_helper.from_array(rounded, tensor.name))
    onnx.save(model, str(path))


def pack(path: Path) -> Path:
    """Replaces a file by its gzip, the same bytes for the same content; returns its path."""
    packed = path.with_name(path.name + ".gz")
    packed.write_bytes(gzip.compress(path.read_bytes(), 9, mtime=0))
    path.unlink()
    return packed
