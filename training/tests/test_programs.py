"""The command lines that train, end to end on a generated data set: resume, own classes, sets of photos, refusals."""

import itertools
import json
import unittest
import unittest.mock

import torch
import yaml

import convert_backbone
import evaluate_detector
import export_detector
import export_int8
import export_torch
import train_detector
from common import training
from detector import CLASSES, pretrained
from detector.network import Backbone, Widths
from detector.training import SETTLING_VIEWS, VIEWS

from .programs import ProgramCase, quietly
from .synthetic import write_own, write_sets


class TrainingPrograms(ProgramCase):
    def test_a_stopped_run_continues_as_if_it_had_not(self):
        self.assertEqual(self.train("whole"), (0, ""))
        whole = torch.load(self.root / "whole" / "last.pt")

        save = training.save_atomically

        def stop_after_second(content, path):
            save(content, path)
            if content["epoch"] == 2:
                raise KeyboardInterrupt

        training.save_atomically = stop_after_second
        try:
            with self.assertRaises(KeyboardInterrupt):
                self.train("stopped")
        finally:
            training.save_atomically = save
        self.assertEqual(self.train("stopped", "--resume"), (0, ""))
        continued = torch.load(self.root / "stopped" / "last.pt")
        self.assertEqual(continued["epoch"], 3)
        for name, tensor in whole["average"].items():
            torch.testing.assert_close(continued["average"][name], tensor, rtol=0, atol=0, msg=name)

    def test_precision_is_the_checkpoints_else_what_the_device_is_fast_in(self):
        with unittest.mock.patch.object(training, "calculates_in_bf16", lambda device: True):
            self.assertEqual(training.precision_on("cpu", "auto", None), "bf16")
            self.assertEqual(training.precision_on("cpu", "fp32", None), "fp32")
            self.assertEqual(training.precision_on("cpu", "auto", {"settings": {"precision": "fp32"}}), "fp32")
        with unittest.mock.patch.object(training, "calculates_in_bf16", lambda device: False):
            self.assertEqual(training.precision_on("cpu", "auto", None), "fp32")
            self.assertEqual(training.precision_on("cpu", "bf16", None), "bf16")
            self.assertEqual(training.precision_on("cpu", "auto", {"settings": {}}), "bf16", "as older runs were")

    def test_by_the_clock_the_schedule_ends_with_its_minutes(self):
        ticks = itertools.count(step=10)  # so many seconds from one look at the clock to the next: an epoch takes 30
        with unittest.mock.patch.object(train_detector.time, "monotonic", lambda: float(next(ticks))):
            self.assertEqual(self.train("clock", "--minutes", 2, "--settle", 0.5), (0, ""))
        state = torch.load(self.root / "clock" / "last.pt")
        self.assertEqual((state["epoch"], state["trained_s"]), (4, 120.0))
        rates = [group["lr"] for group in state["optimizer"]["param_groups"]]
        self.assertLess(max(rates), 0.1 * state["settings"]["learning_rate"], "the rate does not come down")
        settings = train_detector.Settings(minutes=2, settle=0.5)
        self.assertIs(settings.views_of(1, 59.0), VIEWS["crops"])
        self.assertIs(settings.views_of(2, 60.0), SETTLING_VIEWS)

    def test_a_torn_checkpoint_is_named_with_the_way_out(self):
        self.assertEqual(self.train("torn"), (0, ""))
        last = self.root / "torn" / "last.pt"
        whole = last.read_bytes()
        for data in (b"", bytes(len(whole)), whole[: len(whole) // 2]):
            last.write_bytes(data)
            status, said = self.train("torn", "--resume")
            self.assertEqual(status, 2, said)
            self.assertEqual(len(said.splitlines()), 1, said)
            self.assertIn(f"{last} is torn or no checkpoint", said)
            self.assertIn("remove it to begin anew", said)

    def test_begins_with_a_pretrained_backbone_and_leaves_a_frozen_part_of_it(self):
        torch.manual_seed(2)
        blocks = pretrained.blocks_of(Backbone(Widths()))
        convolutions = [(block[0].weight.detach(), 0.1 * torch.randn(len(block[0].weight))) for block in blocks]
        path = self.root / "backbone.pt"
        torch.save({"convolutions": convolutions}, path)
        more = ("--pretrained", path, "--freeze", "--views", "frames", "--backbone-rate", 0.5)
        self.assertEqual(self.train("pretrained", *more), (0, ""))
        model = torch.load(self.root / "pretrained" / "last.pt")["model"]
        for name, block, still in (
            ("backbone.stem.0", 0, True), ("backbone.stride4.leave", 4, False), ("backbone.stride16.leave", 16, False)
        ):
            # The normalisation's unfolding scales each filter; its direction stays.
            now, begin = model[name + ".0.weight"].flatten(1), convolutions[block][0].flatten(1)
            same = torch.nn.functional.cosine_similarity(now, begin).min() > 0.999999
            self.assertEqual(bool(same), still, name)
        other = ("--start-from", self.root / "pretrained" / "last.pt", "--pretrained", path)
        self.assertEqual(self.train("both", *other)[0], 2)
        torch.save({"convolutions": convolutions[:3]}, path)
        self.assertEqual(self.train("short", "--pretrained", path)[0], 2)

    def test_a_class_of_the_users_own_is_trained_and_exported_without_a_change_of_the_programs(self):
        own = write_own(self.root / "own")
        first = self.root / "eight" / "last.pt"
        self.assertEqual(self.train("eight"), (0, ""))
        self.assertEqual(self.train("nine", "--own", own, "--start-from", first), (0, ""))
        begun, state = torch.load(first), torch.load(self.root / "nine" / "last.pt")
        self.assertEqual(state["settings"]["classes"], (*CLASSES, "sinkhole"))
        self.assertEqual(len(state["model"]["heads.0.score.1.weight"]), len(begun["model"]["heads.0.score.1.weight"]) + 1)
        models = self.root / "own_models"
        models.mkdir()
        export = ("--checkpoint", self.root / "nine" / "last.pt", "--name", "mine", "--out", models)
        self.assertEqual(quietly(export_detector, *export, "--data", self.data, "--own", own), (0, ""))
        manifest = yaml.safe_load((models / "mine.yaml").read_text())
        self.assertEqual(manifest["classes"], [*CLASSES, "sinkhole"])
        self.assertEqual(list(manifest["thresholds"]), manifest["classes"])
        self.assertNotEqual(manifest["thresholds"]["sinkhole"], export_detector.UNCALIBRATED_THRESHOLD)
        self.assertEqual(quietly(evaluate_detector, "--manifest", models / "mine.yaml", "--data", self.data), (0, ""))
        # What was exported begins the next training, and its mean with others, with its classes.
        self.assertEqual(self.train("ten", "--own", own, "--start-from", models / "mine.onnx"), (0, ""))
        again = ("--checkpoint", models / "mine.onnx", "--checkpoint", self.root / "ten" / "last.pt", "--name", "mean", "--out", models)
        self.assertEqual(quietly(export_detector, *again, "--data", "none"), (0, ""))
        for begun in (self.root / "nine" / "last.pt", models / "mine.onnx"):
            status, errors = self.train("back", "--start-from", begun)
            self.assertEqual((status, "which ours do not begin with" in errors), (2, True), begun)
        status, errors = quietly(export_detector, "--checkpoint", first, "--name", "x", "--out", models, "--own", own)
        self.assertEqual((status, "sinkhole" in errors), (2, True))

    def test_sets_of_photos_are_trained_and_their_held_out_parts_choose(self):
        listed = write_sets(self.data)
        self.assertEqual(self.train("sets", "--sets", listed, "--cut-outs"), (0, ""))
        state = torch.load(self.root / "sets" / "last.pt")
        figures = json.loads((self.root / "sets" / "figures.json").read_text())
        self.assertEqual([entry["epoch"] for entry in figures], [3])
        self.assertEqual(set(figures[0]["pooled"]), {"pothole", "deer", "road_work_sign"})
        self.assertEqual(figures[0]["by_set"]["deer"]["cattle"]["pictures"], 2)
        self.assertEqual(state["history"], figures)
        models = self.root / "models_of_sets"
        models.mkdir()
        export = ("--checkpoint", self.root / "sets" / "last.pt")
        self.assertEqual(quietly(export_detector, *export, "--name", "photos", "--out", models, "--data", self.data, "--sets", listed), (0, ""))
        measured = ("--manifest", models / "photos.yaml", "--data", self.data, "--sets", listed)
        self.assertEqual(quietly(evaluate_detector, *measured), (0, ""))
        sheets = self.root / "mistakes"
        self.assertEqual(quietly(evaluate_detector, *measured, "--mistakes", sheets), (0, ""))
        listed_mistakes = (sheets / "mistakes.csv").read_text().splitlines()
        self.assertEqual(listed_mistakes[0], "class,kind,set,image,score,x_min,y_min,x_max,y_max")
        self.assertGreater(len(listed_mistakes), 1)
        kinds = {tuple(line.split(",")[:2]) for line in listed_mistakes[1:]}
        self.assertEqual({path.stem for path in sheets.glob("*.jpg")}, {"-".join(kind) for kind in kinds})
        status, errors = quietly(evaluate_detector, *measured, "--mistakes", sheets)
        self.assertEqual((status, "accepted is a new folder" in errors), (2, True))
        self.assertIn("left_out", self.train("sets", "--sets", listed, "--cut-outs", "--leave-out", "cattle", "--resume")[1])
        listed.write_text(listed.read_text() + "# Another split.\n")
        self.assertIn("sets", self.train("sets", "--sets", listed, "--cut-outs", "--resume")[1])
        self.assertIn("--leave-out wants --sets", self.train("new", "--leave-out", "cattle")[1])
        self.assertIn("--data", self.train("new", "--sets", listed, "--data", "none")[1])

    def test_own_pictures_alone_suffice(self):
        own = write_own(self.root / "alone")
        self.assertEqual(self.train("alone_out", "--data", "none", "--own", own), (0, ""))
        self.assertIn("--own", self.train("nothing", "--data", "none")[1])
        (own / "classes.txt").write_text("Sink-Hole\npothole\n")
        self.assertIn("Sink-Hole", self.train("misnamed", "--data", "none", "--own", own)[1])

    def test_refusals_are_one_sentence_and_status_2(self):
        nowhere = self.root / "nowhere"
        cases = [
            (train_detector, ("--data", nowhere, "--out", self.root / "new")),
            (train_detector, ("--epochs", 0)),
            (train_detector, ("--start-from", nowhere, "--out", self.root / "new")),
            (train_detector, ("--batch", 1)),
            (train_detector, ("--backbone-rate", 20)),
            (train_detector, ("--minutes", "nan")),
            (convert_backbone, ("--archive", nowhere, "--out", self.root / "new.pt")),
            (train_detector, ("--frobnicate",)),
            (export_detector, ("--out", self.root)),
            (export_detector, ("--name", "x", "--checkpoint", nowhere, "--out", self.root)),
            (export_detector, ("--name", "x", "--out", nowhere)),
            (export_detector, ("--name", "x", "--input", "640x401", "--out", self.root)),
            (export_detector, ("--name", "x", "--scales", "1,0.7", "--out", self.root)),
            (export_detector, ("--name", "x", "--scales", "1,0.8", "--input", "320x208", "--out", self.root)),
            (train_detector, ("--own", nowhere, "--out", self.root / "new")),
            (evaluate_detector, ("--manifest", nowhere)),
            (export_torch, (nowhere,)),
            (export_int8, (nowhere, "--data", "none")),
        ]
        for program, arguments in cases:
            status, errors = quietly(program, *arguments)
            self.assertEqual(status, 2, arguments)
            self.assertEqual(errors.strip().splitlines()[-1].count("\n"), 0)
            self.assertNotIn("Traceback", errors)


if __name__ == "__main__":
    unittest.main()
