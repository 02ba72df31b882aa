#!/usr/bin/python3
"""Writes tiny.onnx and tiny.yaml, tiny_score.onnx and tiny_score.yaml, and calibration pictures: models whose answers are known functions of the image.

    test/perception/inference/make_tiny_model.py [FOLDER [PICTURES]]
    training/export_torch.py test/perception/inference/tiny.yaml      (adds tiny.pt)
    training/export_int8.py test/perception/inference/tiny_int8.yaml --data none --pictures PICTURES --count 8

The last adds tiny_int8.int8.pt, calibrated on the pictures of coloured blocks that are written into the folder PICTURES.
tiny_int8.yaml is tiny.yaml, with its torch_file, under another name.

It "detects" coloured blocks: a cell of 8x8 (or 16x16) pixels that is red is a pothole, one that is
green a traffic cone. With r, g the cell's mean red and green (0..1):

    objectness = sigmoid(20 (r + g) - 10)    pothole = sigmoid(20 (r - g))    cone = sigmoid(20 (g - r))
    tx = ty = 0.5    tw = ln 2 * r    th = 0

so that a full red cell's box is two cells wide and one cell high around the cell's centre.

tiny_score judges the whole image: the highest of sigmoid(20 (r - g) - 10) over all cells of 8x8 pixels.
"""

import hashlib
import math
import sys
from pathlib import Path

import cv2
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

WIDTH, HEIGHT = 64, 48
STRIDES = (8, 16)


def level(stride):
    """Nodes and constants that turn `images` into the rows of one level."""
    cells = (HEIGHT // stride) * (WIDTH // stride)
    name = f"level{stride}"
    box_weights = np.zeros((4, 3, 1, 1), np.float32)
    box_weights[2, 0] = math.log(2)
    box_bias = np.array([0.5, 0.5, 0, 0], np.float32)
    score_weights = np.array([[20, 20, 0], [20, -20, 0], [-20, 20, 0]], np.float32).reshape(3, 3, 1, 1)
    score_bias = np.array([-10, 0, 0], np.float32)
    constants = {
        f"{name}_box_weights": box_weights, f"{name}_box_bias": box_bias,
        f"{name}_score_weights": score_weights, f"{name}_score_bias": score_bias,
        f"{name}_shape": np.array([1, 7, cells], np.int64),
    }
    nodes = [
        helper.make_node("AveragePool", ["images"], [f"{name}_means"], kernel_shape=[stride] * 2, strides=[stride] * 2),
        helper.make_node("Conv", [f"{name}_means", f"{name}_box_weights", f"{name}_box_bias"], [f"{name}_boxes"], kernel_shape=[1, 1]),
        helper.make_node("Conv", [f"{name}_means", f"{name}_score_weights", f"{name}_score_bias"], [f"{name}_logits"], kernel_shape=[1, 1]),
        helper.make_node("Sigmoid", [f"{name}_logits"], [f"{name}_scores"]),
        helper.make_node("Concat", [f"{name}_boxes", f"{name}_scores"], [f"{name}_map"], axis=1),
        helper.make_node("Reshape", [f"{name}_map", f"{name}_shape"], [f"{name}_columns"]),
        helper.make_node("Transpose", [f"{name}_columns"], [f"{name}_rows"], perm=[0, 2, 1]),
    ]
    return nodes, constants


def checked(graph):
    """The model of a graph, as OpenCV 4.6 reads it."""
    model = helper.make_model(graph, producer_name="livemap", opset_imports=[helper.make_opsetid("", 11)])
    model.ir_version = 6
    onnx.checker.check_model(model)
    return model


def make_score_model():
    """The network that judges whole images."""
    constants = {
        "weights": np.array([20, -20, 0], np.float32).reshape(1, 3, 1, 1), "bias": np.array([-10], np.float32),
    }
    nodes = [
        helper.make_node("AveragePool", ["images"], ["means"], kernel_shape=[8, 8], strides=[8, 8]),
        helper.make_node("Conv", ["means", "weights", "bias"], ["logits"], kernel_shape=[1, 1]),
        helper.make_node("MaxPool", ["logits"], ["highest"], kernel_shape=[HEIGHT // 8, WIDTH // 8]),
        helper.make_node("Flatten", ["highest"], ["flat"], axis=1),
        helper.make_node("Sigmoid", ["flat"], ["score"]),
    ]
    return checked(helper.make_graph(
        nodes, "tiny_score",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, HEIGHT, WIDTH])],
        [helper.make_tensor_value_info("score", TensorProto.FLOAT, [1, 1])],
        [numpy_helper.from_array(array, name) for name, array in constants.items()],
    ))


def make_model():
    """The network that detects."""
    nodes, constants = [], {}
    for stride in STRIDES:
        level_nodes, level_constants = level(stride)
        nodes += level_nodes
        constants.update(level_constants)
    nodes.append(helper.make_node("Concat", [f"level{stride}_rows" for stride in STRIDES], ["predictions"], axis=1))
    rows = sum((HEIGHT // stride) * (WIDTH // stride) for stride in STRIDES)
    graph = helper.make_graph(
        nodes, "tiny",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, HEIGHT, WIDTH])],
        [helper.make_tensor_value_info("predictions", TensorProto.FLOAT, [1, rows, 7])],
        [numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    return checked(graph)


def write_pictures(folder):
    """Blocks of every red and green."""
    rng = np.random.default_rng(1)
    for index in range(8):
        picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        picture[..., 1:] = np.kron(rng.integers(0, 256, (HEIGHT // 8, WIDTH // 8, 2)), np.ones((8, 8, 1)))
        if index == 0:
            picture[: HEIGHT // 2], picture[HEIGHT // 2 :] = (0, 255, 0), (0, 0, 255)
        cv2.imwrite(str(folder / f"{index}.png"), picture)


def main():
    """Writes all files."""
    if len(sys.argv) > 2:
        write_pictures(Path(sys.argv[2]))
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    model = make_model().SerializeToString()
    (folder / "tiny.onnx").write_bytes(model)
    (folder / "tiny.yaml").write_text(f"""\
# Written by test/perception/inference/make_tiny_model.py, which says what this model does.
name: tiny
file: tiny.onnx
sha256: {hashlib.sha256(model).hexdigest()}
classes: [pothole, traffic_cone]
input: {{width: {WIDTH}, height: {HEIGHT}, channels: rgb, resize: letterbox, pad_value: 0}}
normalisation: {{mean: [0, 0, 0], std: [255, 255, 255]}}
head: {{type: yolox, strides: [{", ".join(map(str, STRIDES))}], output: predictions}}
thresholds: {{pothole: 0.6, traffic_cone: 0.7}}
nms_iou: 0.5
""")
    model = make_score_model().SerializeToString()
    (folder / "tiny_score.onnx").write_bytes(model)
    (folder / "tiny_score.yaml").write_text(f"""\
# Written by test/perception/inference/make_tiny_model.py, which says what this model does.
name: tiny_score
file: tiny_score.onnx
sha256: {hashlib.sha256(model).hexdigest()}
classes: [hazard]
input: {{width: {WIDTH}, height: {HEIGHT}, channels: rgb, resize: letterbox, pad_value: 0}}
normalisation: {{mean: [0, 0, 0], std: [255, 255, 255]}}
head: {{type: score, output: score}}
thresholds: {{hazard: 0.4}}
""")


if __name__ == "__main__":
    main()
