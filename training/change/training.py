"""Parts of the training loop; what all trainers share is in common/training.py."""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader

from common.training import EpochSamples, decayed_groups

from .augment import SETTLING, Recipe, Sample
from .inference import MEAN, STD
from .network import Network


@dataclass(frozen=True)
class Settings:
    """What determines a training run. A resumed run must have been started with the same settings."""

    architecture: str = "change-small"
    seed: int = 1
    pretrain: int = 8  # first epochs, in which the encoder learns what things are
    epochs: int = 80  # in all
    samples_per_epoch: int = 480
    batch: int = 8
    learning_rate: float = 2e-3
    weight_decay: float = 0.02
    settle: float = 0.25  # last fraction of the epochs: whole pictures, weaker changes
    precision: str = "bf16"
    refine: bool = False  # all is trained, the surroundings' verdict included, and no normalisation is measured anew

    def recipe_of(self, epoch: int) -> Recipe:
        """How the samples of an epoch are made."""
        return SETTLING if epoch >= self.epochs - round(self.settle * self.epochs) else Recipe()

    def share_of(self, epoch: int) -> float:
        """Of samples and batch, so that steps cost about the same at all sizes."""
        return 0.5 if self.recipe_of(epoch) is SETTLING else 1.0


def collate(samples: List[Sample]) -> Tuple[Tensor, Tensor, Tensor]:
    """Samples to first and second pictures (uint8, B x 3 x H x W) and masks (B x H x W, int64)."""
    first, second = (
        torch.from_numpy(np.stack([getattr(sample, name) for sample in samples])).permute(0, 3, 1, 2)
        for name in ("first", "second")
    )
    return first, second, torch.from_numpy(np.stack([sample.mask for sample in samples]).astype(np.int64))


def batches(samples: EpochSamples, batch: int, workers: int) -> DataLoader:
    """Batches of an epoch in order; the samples themselves are random."""
    return DataLoader(samples, batch_size=batch, num_workers=workers, collate_fn=collate, drop_last=True)


def to_input(images: Tensor, device: torch.device) -> Tensor:
    """Pictures on the device, normalised."""
    return (images.to(device).float() - MEAN) / STD


def make_optimizer(network: Network, settings: Settings) -> torch.optim.Optimizer:
    """AdamW; biases and normalisation parameters do not decay."""
    return torch.optim.AdamW(decayed_groups(network, settings.weight_decay), lr=settings.learning_rate)
