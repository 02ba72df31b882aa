#!/usr/bin/python3
"""Train the small vehicle's send / don't-send classifier.

    training/train_discard.py --data ../shared/data --sets training/real_hazards.yaml --judge models/hazards-base.yaml \
        --out build/training/discard

A run that was stopped, at whatever moment, continues with the same command and --resume.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import cv2
import numpy as np
import torch
from torch import Tensor

sys.path.insert(0, str(Path(__file__).parent))
from common.training import (
    EpochSamples, Run, add_run_arguments, check_arguments, checkpoint_to_resume, decayed_groups, exit_status, fields_given,
    learning_rate_factor, prepare_device,
)
from detector import sets
from detector.augment import GROUP_SHARES, Augmenter, Recipe
from detector.data import DataError, Picture
from detector.loss import Target
from detector.int8_model import forward_of
from detector.manifest import ManifestError, read_manifest, sha256_of
from detector.training import collate
from detector.validation import DetectorRunner
from early_discard import INPUT_HEIGHT, INPUT_WIDTH, labels, photos
from early_discard.loss import losses
from early_discard.network import Features, Head, NetworkError, cut_backbone

RECIPE = Recipe(
    mosaic=0.0, mix=0.0, paste=0.15, scale_spread=1.2, aspect_spread=1.05, focus=0.2, blur=0.08, noise=0.08, grey=0.04,
    shadow=0.2, relight=0.15, erase=0.0, hue=4.0, saturation=0.4, brightness=0.3, white=0.05,
)
"""Whole frames, mirrored, moved and relit a little: what the vehicle's camera sees."""

SHARES = {**GROUP_SHARES, "survey_potholes": 0.17, "survey_empty": 0.23, "closeups": 0.02, "cones": 0.16, "set": 0.42}
"""Photos of sets nearly always show a hazard: as many survey frames without one stand beside them."""

DEFAULT_DETECTOR = Path(__file__).parents[1] / "models" / "hazards-small.onnx"


@dataclass(frozen=True)
class Settings:
    """What determines a training run. A resumed run must have been started with the same settings."""

    seed: int = 1
    samples: int = 3600  # drawn once: the backbone's features of them are computed once
    epochs: int = 4
    batch: int = 16
    learning_rate: float = 2e-3
    weight_decay: float = 0.05
    sets: str = ""  # digest of the file of sets: another split is another run
    judge: str = ""  # digest of the judge's weights


class Samples:
    """Features and targets of the samples, in memory as 16-bit floats (0.4 MB each)."""

    def __init__(self, pictures: dict, features: Features, settings: Settings):
        augmenter = Augmenter(
            pictures, RECIPE, INPUT_WIDTH, INPUT_HEIGHT, letterbox=(INPUT_WIDTH, INPUT_HEIGHT), shares_of_kinds=SHARES
        )
        drawn = EpochSamples(augmenter, settings.seed, 0, settings.samples)
        self.features: List[Tuple[np.ndarray, ...]] = []
        self.targets: List[Target] = []
        for index in range(settings.samples):
            sample = drawn[index]
            self.features.append(tuple(level.astype(np.float16) for level in features.of(sample.image)))
            self.targets += collate([sample])[1]

    def batch(self, rows: np.ndarray) -> Tuple[List[Tensor], List[Target]]:
        """Some of them, as one tensor per level."""
        levels = zip(*(self.features[row] for row in rows))
        return [torch.from_numpy(np.stack(level)).float() for level in levels], [self.targets[row] for row in rows]


class Trainer(Run):
    """A run of the classifier's head."""

    def __init__(self, settings: Settings):
        torch.manual_seed(settings.seed)
        head = Head()
        super().__init__(settings, head, torch.optim.AdamW(decayed_groups(head, settings.weight_decay), lr=settings.learning_rate))

    def train_epoch(self, samples: Samples) -> Dict[str, float]:
        """One pass over the samples in a random order; returns mean losses."""
        settings = self.settings
        # Dropout draws from torch's generator: seeded by epoch, a resumed run draws the same.
        torch.manual_seed(settings.seed * 100003 + self.epoch)
        order = np.random.default_rng([settings.seed, 1 + self.epoch]).permutation(settings.samples)
        steps = settings.samples // settings.batch
        sums = torch.zeros(2)
        self.model.train()
        for step in range(steps):
            self.set_rate(settings.learning_rate * learning_rate_factor((self.epoch + step / steps) / settings.epochs))
            features, targets = samples.batch(order[step * settings.batch : (step + 1) * settings.batch])
            both = torch.stack(losses(self.model(*features), targets))
            self.step(both.sum())
            sums += both.detach()
        self.epoch += 1
        of_cells, of_frames = (sums / steps).tolist()
        return {"cell_loss": of_cells, "frame_loss": of_frames}


def parse_arguments(arguments: Optional[List[str]]) -> argparse.Namespace:
    """The command line; argparse itself exits with 2 on a wrong flag."""
    defaults = Settings()
    parser = argparse.ArgumentParser(description="Train the send / don't-send classifier.")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets")
    parser.add_argument("--simulated", type=Path, help="folder of simulated drives (training/simulate_drives.py)")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of labelled photos below --data to train on too")
    parser.add_argument("--judge", type=Path, metavar="MANIFEST", help="a detector that looks for what the sets do not label")
    parser.add_argument("--detector", type=Path, default=DEFAULT_DETECTOR, help="ONNX file whose first stages are taken over")
    add_run_arguments(parser, "build/training/discard", defaults, ("seed", "samples", "epochs", "batch"), threads=1)
    parser.add_argument("--learning-rate", type=float, default=defaults.learning_rate)
    return parser.parse_args(arguments)


def settings_from(arguments: argparse.Namespace) -> Settings:
    """Settings of the command line, checked."""
    check_arguments(arguments)
    given = fields_given(Settings, arguments)
    given["sets"] = sets.read_catalogue(arguments.sets).digest if arguments.sets else ""
    given["judge"] = sha256_of(read_manifest(arguments.judge).weights)[:12] if arguments.judge else ""
    return Settings(**given)


def open_judge(path: Path) -> photos.Judge:
    """The detector of a manifest, in the precision that it names."""
    manifest = read_manifest(path)
    return DetectorRunner(forward_of(manifest), manifest.view).detect


def read_pictures(arguments: argparse.Namespace) -> Dict[str, List[Picture]]:
    """All that the head learns from, by group."""
    pictures = labels.read_training_pictures(arguments.data, arguments.simulated)
    if arguments.sets:
        judge = open_judge(arguments.judge) if arguments.judge else None
        calm = labels.read_calm_roads(arguments.data)
        pictures.update(photos.read_groups(sets.read_catalogue(arguments.sets), arguments.data, judge, calm, arguments.seed))
    return pictures


def run(arguments: argparse.Namespace) -> None:
    """Train from the checkpoint, or from the start, to the last epoch."""
    settings = settings_from(arguments)
    device = prepare_device(arguments)
    cv2.setNumThreads(arguments.threads)  # it runs the backbone
    trainer = Trainer(settings)
    begun = checkpoint_to_resume(arguments, device)
    if begun:
        trainer.restore(begun)
    pictures = read_pictures(arguments)
    counted = {name: f"{sum(map(labels.holds_hazard, group))} of {len(group)}" for name, group in pictures.items()}
    print(f"frames to send: {counted}", flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    cut_backbone(arguments.detector, arguments.out / "backbone.onnx")
    began = time.monotonic()
    samples = Samples(pictures, Features(arguments.out / "backbone.onnx"), settings)
    print(f"features of {settings.samples} samples {time.monotonic() - began:.0f} s", flush=True)
    trainer.run(arguments.out, lambda: trainer.train_epoch(samples))


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 trained, 2 the command line or the data is wrong."""
    parsed = parse_arguments(arguments)
    return exit_status("train_discard", lambda: run(parsed), (NetworkError, DataError, ManifestError))


if __name__ == "__main__":
    sys.exit(main())
