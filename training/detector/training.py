"""Parts of the training loop: seeded samples, batches, averaged weights, schedule, checkpoints."""

import copy
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Tuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, Dataset

from .augment import Augmenter, Sample
from .inference import MEAN, STD
from .loss import Target


@dataclass(frozen=True)
class Settings:
    """What determines a training run. A resumed run must have been started with the same settings."""

    seed: int = 1
    epochs: int = 120
    samples_per_epoch: int = 960
    batch: int = 16
    width: int = 416  # pixels of a training view
    height: int = 320
    learning_rate: float = 2e-3
    weight_decay: float = 0.05
    settle: float = 0.2  # last fraction of the epochs: whole frames, weak augmentation
    precision: str = "bf16"

    def settling_from(self) -> int:
        """The first epoch of whole frames."""
        return self.epochs - round(self.settle * self.epochs)


class EpochSamples(Dataset):
    """The samples of one epoch. Sample i depends on (seed, epoch, i) only."""

    def __init__(self, augmenter: Augmenter, seed: int, epoch: int, count: int):
        self.augmenter, self.seed, self.epoch, self.count = augmenter, seed, epoch, count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Sample:
        return self.augmenter.draw(np.random.default_rng([self.seed, self.epoch, index]))


def collate(samples: List[Sample]) -> Tuple[Tensor, List[Target]]:
    """Samples to a uint8 batch (B x 3 x H x W, channels last in memory) and targets."""
    images = torch.from_numpy(np.stack([sample.image for sample in samples])).permute(0, 3, 1, 2)
    targets = [
        Target(*(torch.from_numpy(part) for part in (sample.boxes, sample.classes, sample.ignored, sample.labelled)))
        for sample in samples
    ]
    return images, targets


def batches(samples: EpochSamples, batch: int, workers: int) -> DataLoader:
    """Batches of an epoch in order; the samples themselves are random."""
    return DataLoader(samples, batch_size=batch, num_workers=workers, collate_fn=collate, drop_last=True)


def to_device(images: Tensor, targets: List[Target], device: torch.device) -> Tuple[Tensor, List[Target]]:
    """A batch on the device, its images normalised."""
    images = (images.to(device).float() - MEAN) / STD
    moved = [Target(t.boxes.to(device), t.classes.to(device), t.ignored.to(device), t.labelled.to(device)) for t in targets]
    return images, moved


class AveragedModel:
    """Exponential moving average of the weights and of the batch-norm statistics."""

    DECAY = 0.999

    def __init__(self, model: nn.Module):
        self.model = copy.deepcopy(model).eval()
        self.updates = 0

    @torch.no_grad()
    def update(self, model: nn.Module) -> None:
        """Move the average towards the model; early on faster, to forget the random start."""
        self.updates += 1
        decay = min(self.DECAY, (1 + self.updates) / (10 + self.updates))
        for average, current in zip(self.model.state_dict().values(), model.state_dict().values()):
            if average.dtype.is_floating_point:
                average.lerp_(current, 1 - decay)
            else:
                average.copy_(current)


def learning_rate_factor(progress: float, warm_up: float = 0.02, last: float = 0.02) -> float:
    """Linear warm-up, then half a cosine down to `last`; progress runs from 0 to 1."""
    if progress < warm_up:
        return progress / warm_up
    return last + (1 - last) * 0.5 * (1 + math.cos(math.pi * (progress - warm_up) / (1 - warm_up)))


def make_optimizer(model: nn.Module, settings: Settings) -> torch.optim.Optimizer:
    """AdamW; biases and normalisation parameters do not decay."""
    decaying = [parameter for parameter in model.parameters() if parameter.dim() > 1]
    others = [parameter for parameter in model.parameters() if parameter.dim() <= 1]
    return torch.optim.AdamW(
        [{"params": decaying, "weight_decay": settings.weight_decay}, {"params": others, "weight_decay": 0.0}],
        lr=settings.learning_rate,
    )


def save_atomically(content: Dict[str, Any], path: Path) -> None:
    """Write a checkpoint so that a kill at any moment leaves the old or the new one, never a torn one."""
    temporary = path.with_suffix(".tmp")
    torch.save(content, temporary)
    os.replace(temporary, path)
