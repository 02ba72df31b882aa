"""Parts of the detector's training: settings, batches, optimizer; what all trainers share is in common/training.py."""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader

from common.training import EpochSamples, decayed_groups

from . import CLASSES, inference
from .augment import FRAMES, GROUP_SHARES, LIGHT, SETTLING, Recipe, Sample
from .inference import MEAN, STD
from .loss import Target, TargetBatch
from .network import Detector


@dataclass(frozen=True)
class Settings:
    """What determines a training run. A resumed run must have been started with the same settings."""

    size: str = "medium"  # of network.SIZES
    seed: int = 1
    epochs: int = 120
    minutes: float = 0.0  # the schedule runs by the clock, for so long, whatever `epochs` says; 0: by epochs
    samples_per_epoch: int = 960
    batch: int = 16
    views: str = "crops"  # of VIEWS, before settling
    learning_rate: float = 2e-3
    backbone_rate: float = 1.0  # multiple of the learning rate that the backbone gets
    freeze: bool = False  # the first convolution stays as it begins
    weight_decay: float = 0.05
    settle: float = 0.2  # last fraction of the epochs: whole frames, weak augmentation
    precision: str = "bf16"
    simulated_share: float = GROUP_SHARES["simulated"]  # of the samples, where there are simulated drives
    classes: Tuple[str, ...] = CLASSES  # in the order of the outputs
    sets: str = ""  # digest of the file of sets: another split is another run
    cut_outs: bool = False  # hazards of the sets are put onto the roads of other photos
    left_out: Tuple[str, ...] = ()  # sets that are not trained on at all

    def views_of(self, epoch: int, trained_s: float = 0.0) -> "Views":
        """What an epoch shows that begins after so much training: the last ones whole frames, weakly changed."""
        if self.minutes:
            settling = trained_s >= (1 - self.settle) * 60 * self.minutes
        else:
            settling = epoch >= self.epochs - round(self.settle * self.epochs)
        return SETTLING_VIEWS if settling else VIEWS[self.views]


@dataclass(frozen=True)
class Views:
    """What the samples of an epoch show."""

    recipe: Recipe
    width: int  # pixels
    height: int
    share: float  # of the settings' samples and batch, so that steps cost about the same at all sizes


VIEWS = {
    "crops": Views(Recipe(), 416, 320, 1.0), "light": Views(LIGHT, 416, 320, 1.0),
    "frames": Views(FRAMES, inference.INPUT_WIDTH, inference.INPUT_HEIGHT, 0.5),
}
SETTLING_VIEWS = Views(SETTLING, inference.INPUT_WIDTH, inference.INPUT_HEIGHT, 0.5)


def collate(samples: List[Sample]) -> Tuple[Tensor, List[Target]]:
    """Samples to a uint8 batch (B x 3 x H x W, channels last in memory) and targets."""
    images = torch.from_numpy(np.stack([sample.image for sample in samples])).permute(0, 3, 1, 2)
    targets = [
        Target(*(torch.from_numpy(part) for part in (sample.boxes, sample.classes, sample.ignored, sample.labelled)))
        for sample in samples
    ]
    return images, targets


def collate_batch(samples: List[Sample]) -> Tuple[Tensor, TargetBatch]:
    """The same with the targets filled up, which the workers do."""
    images, targets = collate(samples)
    return images, TargetBatch.of(targets)


def batches(samples: EpochSamples, batch: int, workers: int) -> DataLoader:
    """Batches of an epoch in order; the samples themselves are random."""
    return DataLoader(samples, batch_size=batch, num_workers=workers, collate_fn=collate_batch, drop_last=True)


def to_device(images: Tensor, targets: TargetBatch, device: torch.device) -> Tuple[Tensor, TargetBatch]:
    """A batch on the device, its images normalised."""
    return (images.to(device).float() - MEAN) / STD, targets.to(device)


def make_optimizer(model: Detector, settings: Settings) -> torch.optim.Optimizer:
    """AdamW; biases and normalisation parameters do not decay. A group has its multiple of the schedule's learning rate."""
    rest = nn.ModuleList([model.pyramid, model.heads])
    groups = []
    for part, multiple in ((model.backbone, settings.backbone_rate), (rest, 1.0)):
        groups += [{**group, "multiple": multiple} for group in decayed_groups(part, settings.weight_decay)]
    return torch.optim.AdamW(groups, lr=settings.learning_rate)
