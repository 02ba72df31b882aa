#!/usr/bin/python3
"""Train the hazard detector.

    training/train_detector.py --data ../shared/data --out build/training/hazards --seed 1 --epochs 120

A run that was stopped, at whatever moment, continues with the same command and --resume.
"""

import argparse
import json
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import torch

sys.path.insert(0, str(Path(__file__).parent))
from common.training import (
    EpochSamples, ModelEma, Run, UsageError, add_loop_arguments, add_run_arguments, check_arguments, checkpoint_to_resume,
    checkpoint_to_start_from, exit_status, fields_given, learning_rate_factor, load_checkpoint,
    precision_on, prepare_device,
)
from detector import data, sets
from detector.augment import Augmenter
from detector.loss import TaskAlignedLoss
from detector.manifest import ManifestError, classes_of
from detector.network import SIZES, Detector
from detector.pretrained import ConversionError, load_backbone, load_exported
from detector.training import VIEWS, Settings, batches, make_optimizer, to_device
from detector.validation import DetectorRunner, selection_figure, torch_forward, validate, validate_held_out


CALIBRATION_SAMPLES = 64
"""On so many the normalisation of a pretrained backbone is measured."""


class Trainer(Run):
    """A run of the detector."""

    BEST = "mean_AP50"

    def __init__(self, settings: Settings, device: torch.device):
        torch.manual_seed(settings.seed)
        self.device = device
        model = Detector(len(settings.classes), SIZES[settings.size]).to(device, memory_format=torch.channels_last)
        self.frozen = [model.backbone.stem] if settings.freeze else []
        for part in self.frozen:
            part.requires_grad_(False)
        super().__init__(settings, model, make_optimizer(model, settings))
        self.history: List[dict] = []  # of all validations
        self.trained_s = self.last_epoch_s = 0.0  # of all epochs, measuring left out, and of the newest

    def state(self) -> dict:
        """Everything that the next epoch depends on."""
        return {**super().state(), "history": self.history, "trained_s": self.trained_s, "last_epoch_s": self.last_epoch_s}

    def restore(self, state: dict) -> None:
        """Continue from `state`, which must come from a run with the same settings."""
        super().restore(state)
        self.history = state.get("history", [])
        self.trained_s, self.last_epoch_s = state.get("trained_s", 0.0), state.get("last_epoch_s", 0.0)

    def is_done(self) -> bool:
        """By the clock: another epoch would end later than the schedule by more than a tenth of itself."""
        if not self.settings.minutes:
            return super().is_done()
        return self.epoch > 0 and self.trained_s + 0.9 * self.last_epoch_s >= 60 * self.settings.minutes

    def epoch_text(self) -> str:
        """By the clock, how far it is instead of how many there are."""
        if not self.settings.minutes:
            return super().epoch_text()
        return f"{self.epoch} at {self.trained_s / 60:.1f}/{self.settings.minutes:g} min"

    def progress(self, epoch_share: float, epoch_s: float) -> float:
        """How much of the schedule is over, 0 to 1, where so much of the epoch is, which took so long."""
        if self.settings.minutes:
            return min(1.0, (self.trained_s + epoch_s) / (60 * self.settings.minutes))
        return (self.epoch + epoch_share) / self.settings.epochs

    def check_classes(self, begun: Tuple[str, ...]) -> None:
        """Refuse weights whose outputs would become those of other classes."""
        if begun != self.settings.classes[: len(begun)]:
            raise UsageError(f"--start-from: its classes are {', '.join(begun)}, which ours do not begin with.")

    def start_from(self, state: dict) -> None:
        """Begin a new schedule with the averaged weights of another run (a warm restart, SGDR).

        Where that run knew the first of our classes only, the others' outputs begin untrained.
        """
        self.check_classes(tuple(state["settings"].get("classes", ())))
        weights = self.model.state_dict()
        if set(weights) != set(state["average"]):
            raise UsageError("--start-from: the checkpoint is of another network.")
        for name, value in state["average"].items():
            if value.shape != weights[name].shape:  # outputs per class
                value = torch.cat([value, weights[name][len(value) :]])
            weights[name] = value
        self.model.load_state_dict(weights)
        self.ema = ModelEma(self.model)

    def start_from_others(
        self, backbone: Optional[Path], exported: Optional[Path], pictures: dict, pasted: Optional[sets.Pasted] = None
    ) -> None:
        """Begin with the backbone of another network, with what an exported detector shares with ours, or with both."""
        views = VIEWS["crops"]
        augmenter = Augmenter(pictures, views.recipe, views.width, views.height, classes=self.settings.classes, pasted=pasted)
        samples = EpochSamples(augmenter, self.settings.seed, 0, CALIBRATION_SAMPLES)
        images, targets = next(iter(batches(samples, CALIBRATION_SAMPLES, 0)))
        images = to_device(images, targets, self.device)[0]
        if backbone:
            load_backbone(self.model.backbone, backbone, images)
        if exported:
            self.check_classes(classes_of(exported))
            print(f"{load_exported(self.model, exported, images)} convolutions are those of {exported}", flush=True)
        self.ema = ModelEma(self.model)

    def train_epoch(self, pictures: dict, workers: int, pasted: Optional[sets.Pasted] = None) -> dict:
        """One pass over freshly drawn samples; returns mean losses."""
        settings = self.settings
        # Dropout draws from torch's generator: seeded by epoch, a resumed run draws the same.
        torch.manual_seed(settings.seed * 100003 + self.epoch)
        views = settings.views_of(self.epoch, self.trained_s)
        began = time.monotonic()
        augmenter = Augmenter(
            pictures, views.recipe, views.width, views.height, settings.simulated_share, settings.classes, pasted
        )
        batch, count = round(settings.batch * views.share), round(settings.samples_per_epoch * views.share)
        loader = batches(EpochSamples(augmenter, settings.seed, self.epoch, count), batch, workers)
        loss_of = TaskAlignedLoss(views.height, views.width, self.device)
        sums = torch.zeros(2)
        self.model.train()
        for part in self.frozen:
            part.eval()  # their normalisation does not follow the batches either
        for step, (images, targets) in enumerate(loader):
            progress = self.progress(step / len(loader), time.monotonic() - began)
            self.set_rate(settings.learning_rate * learning_rate_factor(progress))
            images, targets = to_device(images, targets, self.device)
            with torch.autocast(self.device.type, dtype=torch.bfloat16, enabled=settings.precision == "bf16"):
                raw = self.model(images)
            losses = torch.stack(loss_of(raw, targets))
            self.step(losses.sum())
            sums += losses.detach().cpu()
        self.epoch += 1
        self.last_epoch_s = time.monotonic() - began
        self.trained_s += self.last_epoch_s
        box_loss, score_loss = (sums / len(loader)).tolist()
        return {"box_loss": box_loss, "score_loss": score_loss}

    def validate(self, drives: dict, cones: list, held_out: Dict[str, List[data.Picture]]) -> dict:
        """Figures of the averaged weights on the validation parts; those by class and set go to the history only."""
        runner = DetectorRunner(torch_forward(self.ema.model, self.device, self.settings.precision))
        parts = validate_held_out(runner, held_out, self.settings.classes)
        report, survey, photos = {}, None, None
        if drives:
            result = validate(runner, drives, cones)
            figures, survey, photos = result.best_drive_figures(), result.pothole_ap(0.5), result.cone_ap(0.5)
            report = {
                "AP50": survey, "AP30": result.pothole_ap(0.3), "cone_AP50": photos,
                "threshold": figures.threshold, "event_recall": figures.event_recall,
                "event_recall_iou30": figures.event_recall_iou30, "false_per_km": figures.false_reports_per_km,
            }
        report.update({f"held_out_{name}": figure.ap50 for name, figure in parts.pooled.items()})
        report["mean_AP50"] = selection_figure(parts, survey, photos)
        self.history.append({"epoch": self.epoch, **report, **asdict(parts)})
        return report


def parse_arguments(arguments: Optional[List[str]]) -> argparse.Namespace:
    """The command line; argparse itself exits with 2 on a wrong flag."""
    defaults = Settings()
    parser = argparse.ArgumentParser(description="Train the hazard detector.")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets; none: own and simulated pictures alone")
    parser.add_argument("--own", type=Path, metavar="DIR", action="append", default=[], help="your own pictures: images/, labels/ and classes.txt, which may name new classes; may be repeated")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of labelled photos below --data, such as training/real_hazards.yaml")
    parser.add_argument("--cut-outs", action="store_true", help="hazards of the sets' photos are cut out and put onto the roads of others")
    parser.add_argument("--leave-out", metavar="SET", action="append", default=[], help="a set that is held out as a whole; may be repeated")
    parser.add_argument("--simulated", type=Path, help="folder of simulated drives (training/simulate_drives.py)")
    parser.add_argument("--start-from", type=Path, metavar="CHECKPOINT", help="averaged weights, or an exported .onnx, to begin a new run with")
    parser.add_argument("--pretrained", type=Path, metavar="BACKBONE", help="file of training/convert_backbone.py to begin with")
    parser.add_argument("--size", choices=tuple(SIZES), default=defaults.size, help="of the network")
    parser.add_argument("--views", choices=tuple(VIEWS), default=defaults.views, help="what epochs before the last show")
    parser.add_argument("--freeze", action="store_true", help="leave the first convolution as it begins")
    parser.add_argument("--backbone-rate", type=float, default=defaults.backbone_rate, help="multiple of the learning rate for the backbone")
    parser.add_argument("--simulated-share", type=float, default=defaults.simulated_share, help="of the samples, from simulated drives")
    add_run_arguments(parser, "build/training/hazards", defaults, ("seed", "epochs", "samples_per_epoch", "batch"))
    parser.add_argument("--minutes", type=float, default=defaults.minutes,
                        help="the schedule runs by the clock and spans so many minutes, whatever --epochs says; 0: it spans the epochs")
    add_loop_arguments(parser, defaults, validate_every=10)
    return parser.parse_args(arguments)


def exported(arguments: argparse.Namespace) -> Optional[Path]:
    """What --start-from names, where that is an exported model and no checkpoint."""
    return arguments.start_from if arguments.start_from and ".onnx" in arguments.start_from.suffixes else None


def settings_from(arguments: argparse.Namespace) -> Settings:
    """Settings of the command line, checked."""
    check_arguments(arguments)
    if not 0 <= arguments.backbone_rate <= 10:
        raise UsageError(f"--backbone-rate must be from 0 to 10, not {arguments.backbone_rate}.")
    if not 0 <= arguments.minutes <= 100000:
        raise UsageError(f"--minutes must be from 0 to 100000, not {arguments.minutes}.")
    if arguments.pretrained and arguments.start_from and not exported(arguments):
        raise UsageError("--pretrained and the checkpoint of --start-from exclude each other.")
    given = fields_given(Settings, arguments)
    given.update(
        classes=data.with_own_classes(arguments.own), sets=catalogue_of(arguments).digest, left_out=tuple(sorted(arguments.leave_out))
    )
    return Settings(**given)


def catalogue_of(arguments: argparse.Namespace) -> sets.Catalogue:
    """What --sets names, else no sets."""
    if arguments.sets and data.is_none(arguments.data):
        raise UsageError("--sets wants the folder of its sets: give --data.")
    if arguments.leave_out and not arguments.sets:
        raise UsageError("--leave-out wants --sets.")
    return sets.read_catalogue(arguments.sets) if arguments.sets else sets.Catalogue((), {})


def read_pictures(arguments: argparse.Namespace, settings: Settings) -> Dict[str, List[data.Picture]]:
    """Training pictures by group, without those of the sets."""
    pictures = {} if data.is_none(arguments.data) else data.read_training_pictures(arguments.data)
    if arguments.simulated:
        pictures["simulated"] = data.read_simulated(arguments.simulated)
    if arguments.own:
        pictures.update(data.read_own(arguments.own, settings.classes))
    if not pictures:
        raise UsageError("--data is none: give --own or --simulated pictures to train on.")
    return pictures


def run(arguments: argparse.Namespace) -> None:
    """Train from the checkpoint, or from the start, to the last epoch."""
    settings = settings_from(arguments)
    device = prepare_device(arguments)
    begun = checkpoint_to_resume(arguments, device)
    trainer = Trainer(replace(settings, precision=precision_on(device, settings.precision, begun)), device)
    if begun:
        trainer.restore(begun)
    elif arguments.start_from:
        checkpoint = checkpoint_to_start_from(arguments)
        if not exported(arguments):
            trainer.start_from(load_checkpoint(checkpoint, device))
    pictures = read_pictures(arguments, settings)
    of_sets = sets.read_pictures(catalogue_of(arguments), arguments.data, arguments.leave_out, settings.cut_outs)
    pictures.update(of_sets.groups)
    if of_sets.pasted and "cones" in pictures:  # signs stand in street photos too, where no cone says that there are road works
        pictures["composed"] += [picture for picture in pictures["cones"] if not len(picture.boxes)]
    if (arguments.pretrained or exported(arguments)) and not begun:
        trainer.start_from_others(arguments.pretrained, exported(arguments), pictures, of_sets.pasted)
    drives = data.read_validation_drives(arguments.data)
    cones = data.read_validation_cones(arguments.data)

    def measure() -> dict:
        report = trainer.validate(drives, cones, of_sets.held_out)
        (arguments.out / "figures.json").write_text(json.dumps(trainer.history, indent=1))
        return report

    trainer.run(
        arguments.out, lambda: trainer.train_epoch(pictures, arguments.workers, of_sets.pasted),
        measure if drives or of_sets.held_out else None, arguments.validate_every,
    )


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 trained, 2 the command line or the data is wrong."""
    parsed = parse_arguments(arguments)
    return exit_status("train_detector", lambda: run(parsed), (ManifestError, ConversionError, data.DataError))


if __name__ == "__main__":
    sys.exit(main())
