"""The command lines that export and measure a network, end to end on a generated data set."""

import unittest
from pathlib import Path

import cv2
import numpy as np
import torch
import yaml

import evaluate_detector
import export_detector
import export_int8
import export_torch
from detector import CLASSES, inference, int8_model, onnx_model
from detector.manifest import sha256_of
from detector.network import SIZES, Detector

from .programs import ProgramCase, quietly


class ExportPrograms(ProgramCase):
    def test_export_and_evaluate(self):
        models = self.root / "models"
        models.mkdir()
        checkpoint = self.root / "random.pt"
        detector = Detector(len(CLASSES), SIZES["medium"])
        torch.save({"settings": {"size": "medium"}, "average": detector.state_dict()}, checkpoint)
        exported = quietly(
            export_detector, "--checkpoint", checkpoint, "--name", "tiny", "--out", models, "--data", self.data, "--packed",
            "--input", "320x240", "--engine", "torch", "--scales", "1,0.8", "--precision", "int8", "--count", "4",
        )
        self.assertEqual(exported, (0, ""))
        arguments = ("--manifest", models / "tiny.yaml", "--data", self.data)
        self.assertEqual(quietly(evaluate_detector, *arguments), (0, ""))
        manifest = yaml.safe_load((models / "tiny.yaml").read_text())
        self.assertEqual((manifest["torch_file"], manifest["torch_sha256"]), ("tiny.pt.gz", sha256_of(models / "tiny.pt.gz")))
        self.assertEqual((manifest["engine"], manifest["input"]["width"], manifest["input"]["height"]), ("torch", 320, 240))
        golden = yaml.safe_load((models / "tiny.golden.yaml").read_text())
        self.assertEqual((manifest["head"]["views"], manifest["head"]["strides"]), (2, [4, 8, 16, 5, 10, 20]))
        whole, smaller = 80 * 60 + 40 * 30 + 20 * 15, 64 * 48 + 32 * 24 + 16 * 12
        self.assertEqual((golden["width"], golden["anchor_points"]), (320, whole + smaller))
        self.assertEqual((manifest["precision"], manifest["int8_file"]), ("int8", "tiny.int8.pt.gz"))
        self.assertEqual(manifest["int8_sha256"], sha256_of(models / "tiny.int8.pt.gz"))
        self.assertEqual([row["index"] for row in golden["int8_rows"]], [row["index"] for row in golden["rows"]])
        self.assertEqual(quietly(evaluate_detector, *arguments, "--precision", "fp32"), (0, ""))
        self.check_eight_bits(models, golden)
        small = ("--size", "small", "--start-from", models / "tiny.onnx.gz")
        self.assertEqual(self.train("small", *small), (0, ""))
        self.assertIn("size small", self.train("small", "--size", "base", "--resume")[1])
        (models / "tiny.onnx.gz").write_bytes(b"something else")
        self.assertIn("SHA-256", quietly(export_torch, models / "tiny.yaml")[1])
        status, errors = quietly(evaluate_detector, *arguments)
        self.assertEqual(status, 2)
        self.assertIn("SHA-256", errors)

    def check_eight_bits(self, models: Path, golden: dict):
        """Both views answer nearly as in float32: boxes within parts of a cell, the certain objectness exactly."""
        pixels = onnx_model.golden_image(320, 240)
        expected = onnx_model.opencv_outputs(models / "tiny.onnx.gz", inference.normalise(pixels)[None])
        found = int8_model.int8_outputs(models / "tiny.int8.pt.gz", (1.0, 0.8))(pixels)
        self.assertEqual(found.shape, expected.shape)
        self.assertTrue((found[..., 4] == expected[..., 4]).all())
        first = 80 * 60 + 40 * 30 + 20 * 15
        for rows in (slice(0, first), slice(first, None)):
            self.assertLess(np.abs(found - expected)[:, rows, :4].mean(), 0.1)
            self.assertLess(np.abs(found - expected)[:, rows, 5:].max(), 0.05)
        for row in golden["int8_rows"]:
            np.testing.assert_allclose(found[0, row["index"]], row["values"], atol=golden["int8_tolerance"])

    def test_a_file_in_eight_bits_is_entered_once_and_leaves_the_rest_of_the_manifest(self):
        source = Path(__file__).resolve().parents[2] / "test" / "perception" / "inference"
        models, pictures = self.root / "eight_bits", self.root / "blocks"
        models.mkdir()
        pictures.mkdir()
        rng = np.random.default_rng(1)
        for index in range(3):
            cv2.imwrite(str(pictures / f"{index}.png"), np.kron(rng.integers(0, 256, (6, 8, 3)), np.ones((8, 8, 1))).astype(np.uint8))
        for name in ("tiny.onnx", "tiny.pt"):
            (models / name).write_bytes((source / name).read_bytes())
        text = (source / "tiny.yaml").read_text()
        (models / "tiny.yaml").write_text("# A comment.\n" + text)
        for _ in range(2):
            arguments = (models / "tiny.yaml", "--data", "none", "--pictures", pictures, "--count", 3)
            self.assertEqual(quietly(export_int8, *arguments), (0, ""))
            lines = (models / "tiny.yaml").read_text().splitlines()
            entered = ["int8_file: tiny.int8.pt", f"int8_sha256: {sha256_of(models / 'tiny.int8.pt')}", "precision: int8", "engine: torch"]
            self.assertEqual([line for line in lines if line not in entered], ["# A comment.", *text.splitlines()])
            self.assertEqual([lines.count(line) for line in entered], [1, 1, 1, 1])
        self.assertNotIn(str(source.parents[1]).encode(), (models / "tiny.int8.pt").read_bytes(), "a path of this machine")
        (models / "tiny.yaml").write_text(text.replace("mean: [0, 0, 0]", "mean: [0, 0, 1]"))
        self.assertIn("normalisation", quietly(export_int8, *arguments)[1])
        (models / "tiny.yaml").write_text(text)
        self.assertIn("picture", quietly(export_int8, models / "tiny.yaml", "--data", "none")[1])

    def test_a_torch_file_is_entered_once_and_leaves_the_rest_of_the_manifest(self):
        source = Path(__file__).resolve().parents[2] / "test" / "perception" / "inference"
        models = self.root / "tiny"
        models.mkdir()
        (models / "tiny.onnx").write_bytes((source / "tiny.onnx").read_bytes())
        text = (source / "tiny.yaml").read_text()
        (models / "tiny.yaml").write_text("# A comment.\n" + text)
        for _ in range(2):
            self.assertEqual(quietly(export_torch, models / "tiny.yaml"), (0, ""))
            lines = (models / "tiny.yaml").read_text().splitlines()
            entered = f"torch_sha256: {sha256_of(models / 'tiny.pt')}"
            self.assertEqual([line for line in lines if line != entered],
                             ["# A comment.", *(line for line in text.splitlines() if "torch_sha256" not in line)])
            self.assertEqual(lines.count(entered), 1)
        self.assertNotIn(str(source.parents[1]).encode(), (models / "tiny.pt").read_bytes(), "a path of this machine")

    def test_objectness_is_one(self):
        exportable = onnx_model.ExportableDetector(Detector(2))
        with torch.no_grad():
            predictions = exportable(torch.rand(1, 3, 64, 64))
        self.assertEqual(tuple(predictions.shape), (1, 336, 7))
        self.assertTrue((predictions[..., 4] == 1).all())


if __name__ == "__main__":
    unittest.main()
