"""Reading a TensorFlow.js graph model and putting its convolutions into our backbone."""

import base64
import contextlib
import io
import json
import os
import tempfile
import unittest
from pathlib import Path
from typing import List

import numpy as np
import torch

import convert_backbone
from detector import CLASSES, inference, onnx_model, pretrained
from detector.network import SIZES, Backbone, CspStage, Detector, PairBlock, Widths

ARCHIVE = os.environ.get("LIVEMAP_BACKBONE_ARCHIVE", "")


class GraphWriter:
    """Writes a graph model as the published one is: paddings apart, convolutions with their channels last."""

    def __init__(self):
        self.nodes: List[dict] = [{"name": "input_1", "op": "Placeholder"}]
        self.entries: List[dict] = []
        self.content = b""
        self.generator = np.random.default_rng(3)
        self.convolutions = 0

    def constant(self, name: str, values, quantised: bool = False) -> str:
        """A weight, 16-bit where it is quantised."""
        table = np.asarray(values, np.float32 if np.asarray(values).dtype.kind == "f" else np.int32)
        entry = {"name": name, "shape": list(table.shape), "dtype": str(table.dtype)}
        if quantised:
            entry["quantization"] = {"dtype": "float16", "original_dtype": "float32"}
            table = table.astype(np.float16)
        self.entries.append(entry)
        self.content += table.tobytes()
        return name

    def node(self, kind: str, name: str, inputs: List[str], **attributes) -> str:
        """A node; its name gets the prefix of the published graph."""
        name = pretrained.NODE_PREFIX + name
        self.nodes.append({"name": name, "op": kind, "input": inputs, "attr": attributes})
        return name

    def window(self, kind: str, suffix: str, source: str, inputs: List[str], stride: int, pad: List[List[int]], **more) -> str:
        """A padded convolution or pooling, channels first on the outside."""
        paddings = self.constant(f"paddings_{kind}{suffix}", np.array(pad))
        padded = [source, paddings]
        if kind == "MaxPool":
            padded.append(self.constant("lowest", np.array(-3.4e38)))
        padded = self.node("PadV2" if kind == "MaxPool" else "Pad", f"Pad_{kind}{suffix}", padded)
        last = self.node("Transpose", f"last_{kind}{suffix}", [padded, self.constant(f"to_{kind}{suffix}", [0, 2, 3, 1])])
        name = "MaxPool2d" if kind == "MaxPool" else f"convolution{suffix}"
        valid = {"s": base64.b64encode(b"VALID").decode()}
        steps = {"list": {"i": ["1", str(stride), str(stride), "1"]}}
        made = self.node(kind, name, [last] + inputs, padding=valid, strides=steps, **more)
        if kind == "Conv2D":
            bias = self.generator.normal(0, 0.2, self.convolution_width).astype(np.float32)
            made = self.node("Add", f"Add{suffix}", [made, self.constant(f"bias{suffix}", bias, True)])
        return self.node("Transpose", f"first_{kind}{suffix}", [made, self.constant(f"back_{kind}{suffix}", [0, 3, 1, 2])])

    def convolve(self, source: str, shape, stride: int, before: int = 1) -> str:
        """A 3x3 convolution and a leaky ReLU; `before` pixels are padded above and left, 1 below and right."""
        suffix = f"_{self.convolutions}" if self.convolutions else ""
        self.convolutions += 1
        self.convolution_width = shape[0]
        kernel = self.generator.normal(0, (9 * shape[1]) ** -0.5, (3, 3, shape[1], shape[0])).astype(np.float32)
        kernel = self.constant(f"kernel{suffix}", kernel, True)
        pad = [[0, 0], [0, 0], [before, 2 - before], [before, 2 - before]]
        made = self.window("Conv2D", suffix, source, [kernel], stride, pad)
        return self.node("LeakyRelu", f"leaky{suffix}", [made], alpha={"f": 0.1})

    def join(self, name: str, first: str, second: str) -> str:
        """Two tensors side by side."""
        return self.node("ConcatV2", name, [first, second, self.constant(f"axis_{name}", np.array(1))])

    def stage(self, stage: CspStage, source: str, level: str) -> str:
        """One stage of the backbone."""
        stride = stage.enter[0].stride[0]
        entered = features = self.convolve(source, stage.enter[0].weight.shape, stride)
        for index, pair in enumerate(stage.pairs):
            assert isinstance(pair, PairBlock)
            first = self.convolve(features, pair.first[0].weight.shape, 1)
            features = self.join(f"pair_{level}_{index}", self.convolve(first, pair.second[0].weight.shape, 1), first)
        left = self.convolve(features, stage.leave[0].weight.shape, 1)
        return self.join(level, left, entered)

    def write(self, folder: Path, shifted: bool = False) -> Path:
        """A random graph of our backbone's shape; `shifted` as TensorFlow's own padding would have it at stride 2."""
        backbone = Backbone(Widths(deep=256))
        features = self.convolve("input_1", backbone.stem[0][0].weight.shape, 2, before=0 if shifted else 1)
        size = {"list": {"i": ["1", "3", "3", "1"]}}
        features = self.window("MaxPool", "", features, [], 2, [[0, 0], [0, 0], [1, 1], [1, 1]], ksize=size)
        names = [name[len(pretrained.NODE_PREFIX):] for name in pretrained.LEVEL_NODES]
        for stage, name in zip((backbone.stride4, backbone.stride8, backbone.stride16, backbone.stride32), names):
            features = self.stage(stage, features, name)
        (folder / "graph.bin").write_bytes(self.content)
        manifest = [{"paths": ["graph.bin"], "weights": self.entries}]
        (folder / "graph.json").write_text(json.dumps({"modelTopology": {"node": self.nodes}, "weightsManifest": manifest}))
        return folder / "graph.json"


class Pretrained(unittest.TestCase):
    def convert(self, shifted: bool) -> list:
        """Convolutions of a random graph."""
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            return convert_backbone.converted(pretrained.GraphModel(GraphWriter().write(Path(folder), shifted)))

    def test_a_graph_is_read_and_a_different_one_refused(self):
        self.assertEqual(len(self.convert(False)), 25)
        with self.assertRaisesRegex(pretrained.ConversionError, "differs from the graph"):
            self.convert(True)

    def test_a_file_that_is_no_graph_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "graph.json"
            for content in ("nonsense", "{}", '{"weightsManifest": [], "modelTopology": {"node": []}}'):
                path.write_text(content)
                with self.assertRaises(pretrained.ConversionError):
                    convert_backbone.converted(pretrained.GraphModel(path))

    def test_the_first_convolution_reads_our_input(self):
        generator = torch.Generator().manual_seed(1)
        weight, bias = torch.randn(4, 3, 3, 3, generator=generator), torch.randn(4, generator=generator)
        rgb = torch.randint(0, 256, (1, 3, 8, 8), generator=generator).float()
        mean, std = (torch.tensor(values)[:, None, None] for values in (pretrained.MEAN_BGR, pretrained.STD_BGR))
        theirs = torch.conv2d((rgb.flip(1) - mean) / std, weight, bias)
        ours = torch.conv2d((rgb - inference.MEAN) / inference.STD, *pretrained.for_our_input(weight, bias))
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-4)

    def test_unfolding_the_normalisation_changes_nothing_but_the_scale(self):
        torch.manual_seed(1)
        backbone = Backbone(Widths())
        blocks = pretrained.blocks_of(backbone)
        pretrained.put_into(backbone, [(0.3 * torch.randn_like(b[0].weight), torch.randn(len(b[0].weight))) for b in blocks])
        images = torch.randn(4, 3, 64, 64)
        backbone.eval()
        with torch.no_grad():
            before = backbone(images)
            pretrained.unfold_normalisation(backbone, images)
            after = backbone(images)
            pretrained.unfold_normalisation(backbone, images)
            again = backbone(images)
            trained = backbone.train()(images)
        for level in range(3):
            scale = float(before[level].abs().max())
            for same in (after, again):
                self.assertLess(float((same[level] - before[level]).abs().max()), 1e-3 * scale)
            self.assertLess(float((trained[level] - before[level]).abs().max()), 2e-2 * scale)
        deviation = torch.std(blocks[0][0](images), dim=(0, 2, 3))
        torch.testing.assert_close(deviation, torch.ones_like(deviation), rtol=1e-3, atol=0)

    def test_an_exported_detector_goes_on_as_it_was_and_gives_another_size_what_they_share(self):
        torch.manual_seed(2)
        images = torch.randn(2, 3, inference.INPUT_HEIGHT, inference.INPUT_WIDTH)
        exported = Detector(len(CLASSES)).eval()
        with torch.no_grad():
            for parameter in exported.parameters():  # torch writes equal tensors, such as biases of 0, but once
                parameter.add_(0.01 * torch.randn_like(parameter))
        pretrained.unfold_normalisation(exported, images)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "exported.onnx"
            onnx_model.export(exported, path)
            same, small = Detector(len(CLASSES)), Detector(len(CLASSES), SIZES["small"])
            self.assertEqual(pretrained.load_exported(same, path, images), 36)
            self.assertEqual(pretrained.load_exported(small, path, images), 28)
            path.write_bytes(b"nonsense")
            with self.assertRaisesRegex(pretrained.ConversionError, "Cannot read the exported detector"):
                pretrained.load_exported(same, path, images)
        with torch.no_grad():
            torch.testing.assert_close(same.eval()(images), exported(images), rtol=1e-3, atol=1e-3)
            expected, taken = exported.backbone(images), small.eval().backbone(images)
        torch.testing.assert_close(taken, expected, rtol=1e-3, atol=1e-3)

    @unittest.skipUnless(Path(ARCHIVE).is_file(), "LIVEMAP_BACKBONE_ARCHIVE names no package as npm pack leaves it")
    def test_the_published_weights(self):
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            out = Path(folder) / "backbone.pt"
            self.assertEqual(convert_backbone.main(["--archive", ARCHIVE, "--out", str(out)]), 0)
            self.assertEqual(len(torch.load(out)["convolutions"]), 25)


if __name__ == "__main__":
    unittest.main()
