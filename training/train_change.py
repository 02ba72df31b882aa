#!/usr/bin/python3
"""Train the change network.

    training/train_change.py --pairs build/training/change --validation build/training/change_validation \
        --data ../shared/data --out build/training/change_small --seed 1

A run that was stopped, at whatever moment, continues with the same command and --resume.

    training/train_change.py --refine --start-from models/change-small.onnx --sets training/real_hazards.yaml --pretrain 0 \
        --pairs build/training/change --data ../shared/data --out build/training/change_roads

goes on with a finished network, of which the export will do, and teaches it small things on the roads of street photos.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import List, Optional, Sequence

import torch

sys.path.insert(0, str(Path(__file__).parent))
from change import data, objects, roads
from change.augment import Augmenter, SceneAugmenter, Source
from change.exported import hold_normalisation, load_averaged
from change.loss import change_loss, class_weights
from change.network import ARCHITECTURES, Network, widened
from change.surroundings import with_present_names
from change.training import Settings, batches, make_optimizer, to_input
from change.validation import RegisteredPair, photo_pairs, registered_pairs, torch_detector, validate
from common.training import (
    EpochSamples, ModelEma, Run, UsageError, add_loop_arguments, add_run_arguments, check_arguments, checkpoint_to_resume,
    checkpoint_to_start_from, exit_status, fields_given, learning_rate_factor, load_checkpoint,
    precision_on, prepare_device,
)

VALIDATION_PHOTOS = 60
"""Pairs of held-out photos with pasted objects."""

BEST_FIGURE = "changes_f1_at_0.01"
"""By which best.pt is chosen; the photos' where there are no pairs."""


class Trainer(Run):
    """A run of the change network."""

    BEST = "selection"
    GRADIENT_NORM = 5.0

    def __init__(self, settings: Settings, device: torch.device, network: Optional[Network] = None):
        torch.manual_seed(settings.seed)
        self.device = device
        network = (network or ARCHITECTURES[settings.architecture]()).to(device)
        super().__init__(settings, network, make_optimizer(network, settings))

    def start_from(self, state: dict) -> None:
        """Begin a new schedule with the averaged weights of another run."""
        try:
            self.model.load_state_dict(widened(with_present_names(state["average"]), self.model))
        except (KeyError, RuntimeError) as error:
            raise UsageError("--start-from: the checkpoint is of another network.") from error
        self.ema = ModelEma(self.model)

    def pretraining(self) -> bool:
        """Whether the next epoch teaches what things are rather than what has changed."""
        return self.epoch < self.settings.pretrain

    def rate(self, progress: float) -> float:
        """The learning rate at a time in epochs; pretraining has a schedule of its own."""
        pretrain, settings = self.settings.pretrain, self.settings
        if self.pretraining():
            return settings.learning_rate * learning_rate_factor(progress / pretrain, last=0.2)
        return settings.learning_rate * learning_rate_factor((progress - pretrain) / max(settings.epochs - pretrain, 1))

    def train_epoch(self, source: Source, workers: int) -> dict:
        """One pass over freshly drawn samples; returns the mean loss."""
        settings, pretraining = self.settings, self.pretraining()
        if self.epoch == settings.pretrain and settings.pretrain > 0:
            self.model.begin_changes()
            self.ema = ModelEma(self.model)
            self.optimizer = make_optimizer(self.model, settings)
        recipe, share = settings.recipe_of(self.epoch), settings.share_of(self.epoch)
        augmenter = SceneAugmenter(source.scenes, recipe) if pretraining else Augmenter(source, recipe)
        masks = [scene.classes for scene in source.scenes] if pretraining else [pair.mask for pair in source.registered]
        weights = class_weights(masks).to(self.device)
        samples = EpochSamples(augmenter, settings.seed, self.epoch, round(settings.samples_per_epoch * share))
        loader = batches(samples, max(round(settings.batch * share), 1), workers)
        total = 0.0
        self.model.train()
        if settings.refine:
            hold_normalisation(self.model)
        for step, (first, second, truth) in enumerate(loader):
            self.set_rate(self.rate(self.epoch + step / len(loader)))
            second = to_input(second, self.device)
            with torch.autocast(self.device.type, dtype=torch.bfloat16, enabled=settings.precision == "bf16"):
                if pretraining:
                    logits = self.model.classify(second)
                else:
                    logits = (self.refined if settings.refine else self.model)(to_input(first, self.device), second)
            loss = change_loss(logits, truth.to(self.device), weights)
            self.step(loss)
            total += loss.item()
        self.epoch += 1
        return {"pretrain_loss" if pretraining else "loss": total / len(loader)}

    def refined(self, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
        """Logits with the verdict of the surroundings; what the warp did not show is ignored in the truth, so that all counts as seen."""
        levels = [self.model.encode(picture) for picture in (first, second)]
        height, width = (size // self.model.logits_stride for size in first.shape[2:])
        return self.model.refined(*levels, torch.zeros(len(first), 1, height, width, device=self.device))

    def validate(self, pairs: Sequence[RegisteredPair]) -> dict:
        """Figures of the averaged weights on held-out pairs; none while the encoder is pretrained."""
        if self.epoch <= self.settings.pretrain:
            return {}
        detect = torch_detector(self.ema.model, self.device, self.settings.precision)
        figures = validate(detect, pairs).figures()
        return {**figures, self.BEST: figures.get(BEST_FIGURE, figures.get("photos_f1_at_0.01")) or 0.0}


def parse_arguments(arguments: Optional[List[str]]) -> argparse.Namespace:
    """The command line; argparse itself exits with 2 on a wrong flag."""
    defaults = Settings()
    parser = argparse.ArgumentParser(description="Train the change network.")
    parser.add_argument("--pairs", type=Path, default=Path("build/training/change"), help="pairs as VL-CMU-CD lays them out")
    parser.add_argument("--validation", type=Path, help="held-out pairs, laid out alike")
    parser.add_argument("--registered", action="store_true", help="the pictures of all pairs lie upon each other already")
    parser.add_argument("--data", type=Path, help="folder of the data sets: photos to paste objects into")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of labelled photos below --data (training/real_hazards.yaml): their streets, and hazards cut out of them")
    parser.add_argument("--start-from", type=Path, metavar="CHECKPOINT", help="averaged weights to begin a new run with, also of a narrower network, or with --refine a whole exported NAME.onnx")
    parser.add_argument("--refine", action="store_true", help="train all of a finished network, with its surroundings, and measure no normalisation anew")
    parser.add_argument("--architecture", choices=tuple(ARCHITECTURES), default=defaults.architecture)
    add_run_arguments(parser, "build/training/change_small", defaults, ("seed", "pretrain", "epochs", "samples_per_epoch", "batch"))
    add_loop_arguments(parser, defaults, validate_every=8)
    return parser.parse_args(arguments)


def settings_from(arguments: argparse.Namespace) -> Settings:
    """Settings of the command line, checked."""
    check_arguments(arguments)
    if arguments.refine and (arguments.pretrain or arguments.start_from is None):
        raise UsageError("--refine goes on with a finished network: it needs --start-from and --pretrain 0.")
    if not arguments.refine and arguments.start_from is not None and arguments.start_from.suffix == ".onnx":
        raise UsageError("--start-from: an exported network can only be trained with --refine.")
    if arguments.sets is not None and arguments.data is None:
        raise UsageError("--sets needs --data, the folder that the sets lie below.")
    if not 0 <= arguments.pretrain < arguments.epochs:
        raise UsageError(f"--pretrain must be from 0 to less than --epochs, not {arguments.pretrain}.")
    return Settings(**fields_given(Settings, arguments))


PAIRS_KEPT_APART = Path(__file__).parent / "change_pairs.yaml"
"""Which real pairs there are to measure on: their pictures are not trained on."""


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
    device = prepare_device(arguments)
    finished = load_averaged(checkpoint_to_start_from(arguments)) if settings.refine else None
    begun = checkpoint_to_resume(arguments, device)
    trainer = Trainer(replace(settings, precision=precision_on(device, settings.precision, begun)), device, finished)
    if begun:
        trainer.restore(begun)
    elif arguments.start_from and finished is None:
        trainer.start_from(load_checkpoint(checkpoint_to_start_from(arguments), device))
    source = read_source(arguments.pairs, arguments.data, arguments.out / "registration.npz", False, arguments.registered)
    if arguments.sets is not None:
        source.roads = roads.read_roads(arguments.data, arguments.sets, PAIRS_KEPT_APART)
        print(
            f"roads: {len(source.roads.photos)} photos, {len(source.roads.places)} pairs of them show one place, "
            f"{sum(map(len, source.roads.cut_outs.values()))} hazards cut out", flush=True,
        )
    if settings.pretrain and not source.scenes:
        raise UsageError(f"--pretrain: below {arguments.pairs} there are no scenes of training/simulate_change.py; set it to 0.")
    if not source.registered and not source.photos and source.roads is None:
        raise UsageError(f"No pair below {arguments.pairs} could be registered, and there are no photos.")
    held_out: List[RegisteredPair] = []
    if arguments.validation:
        cache = arguments.out / "registration_validation.npz"
        validation = read_source(arguments.validation, arguments.data, cache, True, arguments.registered)
        held_out = registered_pairs(validation.pairs) + photo_pairs(validation, VALIDATION_PHOTOS, settings.seed)
    trainer.run(
        arguments.out, lambda: trainer.train_epoch(source, arguments.workers),
        (lambda: trainer.validate(held_out)) if held_out else None, arguments.validate_every,
    )


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 trained, 2 the command line or the data is wrong."""
    parsed = parse_arguments(arguments)
    return exit_status("train_change", lambda: run(parsed), (data.DataError,))


if __name__ == "__main__":
    sys.exit(main())
