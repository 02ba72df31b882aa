#!/usr/bin/python3
"""Train the small vehicle's send / don't-send classifier.

    training/train_discard.py --data ../shared/data --simulated build/training/simulated --out build/training/discard

A run that was stopped, at whatever moment, continues with the same command and --resume.
"""

import argparse
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import cv2
import numpy as np
import torch
from torch import Tensor, nn

sys.path.insert(0, str(Path(__file__).parent))
from detector.augment import Augmenter, Recipe
from detector.data import DataError
from detector.loss import Target
from detector.training import AveragedModel, EpochSamples, collate, learning_rate_factor, save_atomically
from early_discard import INPUT_HEIGHT, INPUT_WIDTH, labels
from early_discard.loss import losses
from early_discard.network import Features, Head, NetworkError, cut_backbone

RECIPE = Recipe(
    mosaic=0.0, mix=0.0, paste=0.25, scale_spread=1.2, aspect_spread=1.05, focus=0.2, blur=0.08, noise=0.08, grey=0.04,
    shadow=0.2, relight=0.15, erase=0.0, hue=4.0, saturation=0.4, brightness=0.3, white=0.05,
)
"""Whole frames, mirrored, moved and relit a little: what the vehicle's camera sees."""

DEFAULT_DETECTOR = Path(__file__).parents[1] / "models" / "hazards-first.onnx"


class UsageError(Exception):
    """The command line or a file it names is wrong; the text is one sentence for the user."""


@dataclass(frozen=True)
class Settings:
    """What determines a training run. A resumed run must have been started with the same settings."""

    seed: int = 1
    samples: int = 2400  # drawn once: the backbone's features of them are computed once
    epochs: int = 16
    batch: int = 16
    learning_rate: float = 2e-3
    weight_decay: float = 0.05


class Samples:
    """Features and targets of the samples, in memory as 16-bit floats (0.27 MB each)."""

    def __init__(self, pictures: dict, features: Features, settings: Settings):
        augmenter = Augmenter(pictures, RECIPE, INPUT_WIDTH, INPUT_HEIGHT)
        drawn = EpochSamples(augmenter, settings.seed, 0, settings.samples)
        self.features: List[np.ndarray] = []
        self.targets: List[Target] = []
        for index in range(settings.samples):
            sample = drawn[index]
            self.features.append(features.of(sample.image).astype(np.float16))
            self.targets += collate([sample])[1]

    def batch(self, rows: np.ndarray) -> Tuple[Tensor, List[Target]]:
        """Some of them, as one tensor."""
        return torch.from_numpy(np.stack([self.features[row] for row in rows])).float(), [self.targets[row] for row in rows]


class Trainer:
    """One training run: state, one epoch, and its checkpoints."""

    def __init__(self, settings: Settings):
        torch.manual_seed(settings.seed)
        self.settings = settings
        self.model = Head()
        self.average = AveragedModel(self.model)
        matrices = [parameter for parameter in self.model.parameters() if parameter.dim() > 1]
        others = [parameter for parameter in self.model.parameters() if parameter.dim() <= 1]
        self.optimizer = torch.optim.AdamW(
            [{"params": matrices, "weight_decay": settings.weight_decay}, {"params": others, "weight_decay": 0.0}],
            lr=settings.learning_rate,
        )
        self.epoch = 0

    def state(self) -> dict:
        """Everything that the next epoch depends on."""
        return {
            "settings": asdict(self.settings), "epoch": self.epoch, "model": self.model.state_dict(),
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
        self.model.load_state_dict(state["model"])
        self.average.model.load_state_dict(state["average"])
        self.average.updates = state["updates"]
        self.optimizer.load_state_dict(state["optimizer"])
        self.epoch = state["epoch"]

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
            progress = (self.epoch + step / steps) / settings.epochs
            for group in self.optimizer.param_groups:
                group["lr"] = settings.learning_rate * learning_rate_factor(progress)
            features, targets = samples.batch(order[step * settings.batch : (step + 1) * settings.batch])
            both = torch.stack(losses(self.model(features), targets))
            self.optimizer.zero_grad(set_to_none=True)
            both.sum().backward()
            nn.utils.clip_grad_norm_(self.model.parameters(), 10.0)
            self.optimizer.step()
            self.average.update(self.model)
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
    parser.add_argument("--detector", type=Path, default=DEFAULT_DETECTOR, help="ONNX file whose first stages are taken over")
    parser.add_argument("--out", type=Path, default=Path("build/training/discard"), help="folder of backbone and checkpoint")
    parser.add_argument("--resume", action="store_true", help="continue from OUT/last.pt where it exists")
    parser.add_argument("--threads", type=int, default=1, help="threads of torch and OpenCV")
    for name in ("seed", "samples", "epochs", "batch"):
        parser.add_argument("--" + name, type=int, default=getattr(defaults, name))
    parser.add_argument("--learning-rate", type=float, default=defaults.learning_rate)
    return parser.parse_args(arguments)


def settings_from(arguments: argparse.Namespace) -> Settings:
    """Settings of the command line, checked."""
    for name in ("epochs", "threads"):
        if getattr(arguments, name) < 1:
            raise UsageError(f"--{name} must be at least 1, not {getattr(arguments, name)}.")
    if arguments.batch < 2 or arguments.samples < arguments.batch:
        raise UsageError(f"--batch must be from 2 to --samples, not {arguments.batch}.")
    if arguments.seed < 0 or not arguments.learning_rate > 0:
        raise UsageError("--seed must not be negative and --learning-rate must be positive.")
    return Settings(**{name: value for name, value in vars(arguments).items() if name in asdict(Settings())})


def run(arguments: argparse.Namespace) -> None:
    """Train from the checkpoint, or from the start, to the last epoch."""
    settings = settings_from(arguments)
    torch.set_num_threads(arguments.threads)
    cv2.setNumThreads(arguments.threads)
    trainer = Trainer(settings)
    last = arguments.out / "last.pt"
    if last.exists():
        if not arguments.resume:
            raise UsageError(f"{last} exists; continue it with --resume or choose another --out.")
        trainer.restore(torch.load(last, map_location="cpu"))
    pictures = labels.read_training_pictures(arguments.data, arguments.simulated)
    counted = {name: f"{sum(map(labels.holds_hazard, group))} of {len(group)}" for name, group in pictures.items()}
    print(f"frames to send: {counted}", flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    cut_backbone(arguments.detector, arguments.out / "backbone.onnx")
    began = time.monotonic()
    samples = Samples(pictures, Features(arguments.out / "backbone.onnx"), settings)
    print(f"features of {settings.samples} samples {time.monotonic() - began:.0f} s", flush=True)

    while trainer.epoch < settings.epochs:
        began = time.monotonic()
        report = trainer.train_epoch(samples)
        save_atomically(trainer.state(), last)
        line = " ".join(f"{name} {value:.3f}" for name, value in report.items())
        print(f"epoch {trainer.epoch}/{settings.epochs} {line} {time.monotonic() - began:.0f} s", flush=True)


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 trained, 2 the command line or the data is wrong."""
    try:
        run(parse_arguments(arguments))
    except (UsageError, NetworkError, DataError) as error:
        print(f"train_discard: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
