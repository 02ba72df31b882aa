#!/usr/bin/python3
"""Train the change network.

    training/train_change.py --pairs build/training/change --validation build/training/change_validation \
        --data ../shared/data --out build/training/change_small --seed 1

A run that was stopped, at whatever moment, continues with the same command and --resume.
"""

import argparse
import sys
import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import List, Optional, Sequence

import cv2
import torch

sys.path.insert(0, str(Path(__file__).parent))
from change import data, objects
from change.augment import Augmenter, SceneAugmenter, Source
from change.loss import change_loss, class_weights
from change.network import ARCHITECTURES, widened
from change.training import Settings, batches, make_optimizer, to_input
from change.validation import RegisteredPair, photo_pairs, registered_pairs, torch_detector, validate
from detector.training import AveragedModel, EpochSamples, learning_rate_factor, save_atomically

VALIDATION_PHOTOS = 60
"""Pairs of held-out photos with pasted objects."""

BEST_FIGURE = "changes_f1_at_0.01"
"""By which best.pt is chosen; the photos' where there are no pairs."""


class UsageError(Exception):
    """The command line or a file it names is wrong; the text is one sentence for the user."""


class Trainer:
    """One training run: state, one epoch, and its checkpoints."""

    def __init__(self, settings: Settings, device: torch.device):
        torch.manual_seed(settings.seed)
        self.settings, self.device = settings, device
        self.network = ARCHITECTURES[settings.architecture]().to(device)
        self.average = AveragedModel(self.network)
        self.optimizer = make_optimizer(self.network, settings)
        self.epoch = 0
        self.best = 0.0

    def state(self) -> dict:
        """Everything that the next epoch depends on."""
        return {
            "settings": asdict(self.settings), "epoch": self.epoch, "best": self.best, "model": self.network.state_dict(),
            "average": self.average.model.state_dict(), "updates": self.average.updates,
            "optimizer": self.optimizer.state_dict(),
        }

    def restore(self, state: dict) -> None:
        """Continue from `state`, which must come from a run with the same settings."""
        for name, value in asdict(self.settings).items():
            if state["settings"].get(name) != value:
                raise UsageError(
                    f"The checkpoint was written with {name} {state['settings'].get(name)}, not {value}; "
                    "resume with the same settings or choose another --out."
                )
        self.network.load_state_dict(state["model"])
        self.average.model.load_state_dict(state["average"])
        self.average.updates = state["updates"]
        self.optimizer.load_state_dict(state["optimizer"])
        self.epoch, self.best = state["epoch"], state["best"]

    def start_from(self, state: dict) -> None:
        """Begin a new schedule with the averaged weights of another run."""
        try:
            self.network.load_state_dict(widened(state["average"], self.network))
        except (KeyError, RuntimeError) as error:
            raise UsageError("--start-from: the checkpoint is of another network.") from error
        self.average = AveragedModel(self.network)

    def pretraining(self) -> bool:
        """Whether the next epoch teaches what things are rather than what has changed."""
        return self.epoch < self.settings.pretrain

    def rate(self, progress: float) -> float:
        """The learning rate at a time in epochs; pretraining has a schedule of its own."""
        pretrain, settings = self.settings.pretrain, self.settings
        if self.pretraining():
            return settings.learning_rate * learning_rate_factor(progress / pretrain, last=0.2)
        return settings.learning_rate * learning_rate_factor((progress - pretrain) / max(settings.epochs - pretrain, 1))

    def train_epoch(self, source: Source, workers: int) -> float:
        """One pass over freshly drawn samples; returns the mean loss."""
        settings, pretraining = self.settings, self.pretraining()
        if self.epoch == settings.pretrain and settings.pretrain > 0:
            self.network.begin_changes()
            self.average = AveragedModel(self.network)
            self.optimizer = make_optimizer(self.network, settings)
        recipe, share = settings.recipe_of(self.epoch), settings.share_of(self.epoch)
        augmenter = SceneAugmenter(source.scenes, recipe) if pretraining else Augmenter(source, recipe)
        masks = [scene.classes for scene in source.scenes] if pretraining else [pair.mask for pair in source.registered]
        weights = class_weights(masks).to(self.device)
        samples = EpochSamples(augmenter, settings.seed, self.epoch, round(settings.samples_per_epoch * share))
        loader = batches(samples, max(round(settings.batch * share), 1), workers)
        total = 0.0
        self.network.train()
        for step, (first, second, truth) in enumerate(loader):
            for group in self.optimizer.param_groups:
                group["lr"] = self.rate(self.epoch + step / len(loader))
            second = to_input(second, self.device)
            with torch.autocast(self.device.type, dtype=torch.bfloat16, enabled=settings.precision == "bf16"):
                if pretraining:
                    logits = self.network.classify(second)
                else:
                    logits = self.network(to_input(first, self.device), second)
            loss = change_loss(logits, truth.to(self.device), weights)
            self.optimizer.zero_grad(set_to_none=True)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
            self.optimizer.step()
            self.average.update(self.network)
            total += loss.item()
        self.epoch += 1
        return total / len(loader)

    def validate(self, pairs: Sequence[RegisteredPair]) -> dict:
        """Figures of the averaged weights on held-out pairs."""
        detect = torch_detector(self.average.model, self.device, self.settings.precision)
        return validate(detect, pairs).figures()


def parse_arguments(arguments: Optional[List[str]]) -> argparse.Namespace:
    """The command line; argparse itself exits with 2 on a wrong flag."""
    defaults = {field.name: field.default for field in fields(Settings)}
    parser = argparse.ArgumentParser(description="Train the change network.")
    parser.add_argument("--pairs", type=Path, default=Path("build/training/change"), help="pairs as VL-CMU-CD lays them out")
    parser.add_argument("--validation", type=Path, help="held-out pairs, laid out alike")
    parser.add_argument("--registered", action="store_true", help="the pictures of all pairs lie upon each other already")
    parser.add_argument("--data", type=Path, help="folder of the data sets: photos to paste objects into")
    parser.add_argument("--out", type=Path, default=Path("build/training/change_small"), help="folder for checkpoints")
    parser.add_argument("--resume", action="store_true", help="continue from OUT/last.pt where it exists")
    parser.add_argument("--start-from", type=Path, metavar="CHECKPOINT", help="averaged weights to begin a new run with, also of a narrower network")
    parser.add_argument("--workers", type=int, default=1, help="processes that prepare samples")
    parser.add_argument("--threads", type=int, default=2, help="threads of torch on the CPU")
    parser.add_argument("--validate-every", type=int, default=8, metavar="EPOCHS")
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto")
    parser.add_argument("--architecture", choices=tuple(ARCHITECTURES), default=defaults["architecture"])
    for name in ("seed", "pretrain", "epochs", "samples_per_epoch", "batch"):
        parser.add_argument("--" + name.replace("_", "-"), type=int, default=defaults[name])
    parser.add_argument("--learning-rate", type=float, default=defaults["learning_rate"])
    parser.add_argument("--settle", type=float, default=defaults["settle"], help="last fraction of the epochs: whole pictures")
    parser.add_argument("--precision", choices=("bf16", "fp32"), default=defaults["precision"])
    return parser.parse_args(arguments)


def settings_from(arguments: argparse.Namespace) -> Settings:
    """Settings of the command line, checked."""
    for name in ("epochs", "samples_per_epoch", "validate_every", "threads"):
        if getattr(arguments, name) < 1:
            raise UsageError(f"--{name.replace('_', '-')} must be at least 1, not {getattr(arguments, name)}.")
    if arguments.batch < 2 or arguments.samples_per_epoch < arguments.batch:
        raise UsageError(f"--batch must be from 2 to --samples-per-epoch, not {arguments.batch}.")
    if arguments.seed < 0 or arguments.workers < 0 or not arguments.learning_rate > 0:
        raise UsageError("--seed and --workers must not be negative and --learning-rate must be positive.")
    if not 0 <= arguments.pretrain < arguments.epochs:
        raise UsageError(f"--pretrain must be from 0 to less than --epochs, not {arguments.pretrain}.")
    if not 0 <= arguments.settle <= 1:
        raise UsageError(f"--settle must be from 0 to 1, not {arguments.settle}.")
    known = {field.name for field in fields(Settings)}
    return Settings(**{name: value for name, value in vars(arguments).items() if name in known})


def read_source(pairs: Path, photos: Optional[Path], cache: Path, validation: bool, registered: bool = False) -> Source:
    """Everything that samples are drawn from, of the training or of the validation side."""
    source = Source(data.read_pairs(pairs, cache, registered), data.read_scenes(pairs))
    if photos is not None:
        source.photos = data.read_photos(photos, validation)
        source.cut_outs = objects.read_cut_outs(photos, source.scenes, validation)
    print(
        f"{'validation' if validation else 'training'}: {len(source.pairs)} pairs, of which "
        f"{sum(pair.homography is not None for pair in source.pairs)} are registered, {len(source.scenes)} scenes, "
        f"{sum(map(len, source.photos.values()))} photos, {sum(map(len, source.cut_outs.values()))} objects to paste", flush=True,
    )
    return source


def run(arguments: argparse.Namespace) -> None:
    """Train from the checkpoint, or from the start, to the last epoch."""
    settings = settings_from(arguments)
    cuda = torch.cuda.is_available()
    if arguments.device == "cuda" and not cuda:
        raise UsageError("--device cuda: this torch sees no CUDA device.")
    device = torch.device("cuda" if cuda and arguments.device != "cpu" else "cpu")
    torch.set_num_threads(arguments.threads)
    cv2.setNumThreads(0)

    trainer = Trainer(settings, device)
    last = arguments.out / "last.pt"
    if last.exists():
        if not arguments.resume:
            raise UsageError(f"{last} exists; continue it with --resume or choose another --out.")
        trainer.restore(torch.load(last, map_location=device))
    elif arguments.start_from:
        if not arguments.start_from.is_file():
            raise UsageError(f"--start-from: there is no checkpoint {arguments.start_from}.")
        trainer.start_from(torch.load(arguments.start_from, map_location=device))
    source = read_source(arguments.pairs, arguments.data, arguments.out / "registration.npz", False, arguments.registered)
    if settings.pretrain and not source.scenes:
        raise UsageError(f"--pretrain: below {arguments.pairs} there are no scenes of training/simulate_change.py; set it to 0.")
    if not source.registered and not source.photos:
        raise UsageError(f"No pair below {arguments.pairs} could be registered, and there are no photos.")
    held_out: List[RegisteredPair] = []
    if arguments.validation:
        cache = arguments.out / "registration_validation.npz"
        validation = read_source(arguments.validation, arguments.data, cache, True, arguments.registered)
        held_out = registered_pairs(validation.pairs) + photo_pairs(validation, VALIDATION_PHOTOS, settings.seed)
    arguments.out.mkdir(parents=True, exist_ok=True)

    while trainer.epoch < settings.epochs:
        began, kind = time.monotonic(), "pretrain_loss" if trainer.pretraining() else "loss"
        report = {kind: trainer.train_epoch(source, arguments.workers)}
        due = trainer.epoch % arguments.validate_every == 0 or trainer.epoch == settings.epochs
        if held_out and due and trainer.epoch > settings.pretrain:
            report.update(trainer.validate(held_out))
            reached = report.get(BEST_FIGURE, report.get("photos_f1_at_0.01", 0.0))
            if reached > trainer.best:
                trainer.best = reached
                save_atomically(trainer.state(), arguments.out / "best.pt")
        save_atomically(trainer.state(), last)
        line = " ".join(f"{name} {value:.4f}" for name, value in report.items())
        print(f"epoch {trainer.epoch}/{settings.epochs} {line} {time.monotonic() - began:.0f} s", flush=True)


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 trained, 2 the command line or the data is wrong."""
    try:
        run(parse_arguments(arguments))
    except (UsageError, data.DataError) as error:
        print(f"train_change: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
