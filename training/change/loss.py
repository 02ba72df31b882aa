"""The loss: weighted cross-entropy over the classes and the overlap of what is changed at all, cell by cell."""

from typing import Sequence, Tuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from .classes import CLASSES, NO_CHANGE
from .data import IGNORED

OVERLAP_WEIGHT = 0.5
"""Of the overlap (Dice) beside the cross-entropy."""

LEAST_WEIGHT, MOST_WEIGHT, MEAN_WEIGHT = 1.5, 5.0, 2.0
"""Of a class of change, where no change weighs 1: rare classes more, by the root of how rare they are."""


def class_weights(masks: Sequence[np.ndarray]) -> Tensor:
    """Weights by class from how often each occurs in the masks."""
    counts = sum((np.bincount(mask.ravel(), minlength=256)[: len(CLASSES)] for mask in masks), np.zeros(len(CLASSES)))
    changes = np.maximum(counts[NO_CHANGE + 1 :], 1)
    weights = np.clip(MEAN_WEIGHT * np.sqrt(changes.mean() / changes), LEAST_WEIGHT, MOST_WEIGHT)
    return torch.tensor(np.concatenate([[1.0], weights]), dtype=torch.float32)


def shares_of(masks: Tensor, stride: int) -> Tuple[Tensor, Tensor]:
    """Masks (B x H x W, int64) to shares of the classes (B x C x h x w) and of what is not ignored (B x h x w) per cell."""
    known = torch.where(masks == IGNORED, torch.full_like(masks, len(CLASSES)), masks)
    shares = F.one_hot(known, len(CLASSES) + 1)[..., :-1].permute(0, 3, 1, 2).float()
    if stride > 1:
        shares = F.avg_pool2d(shares, stride)
    return shares, shares.sum(dim=1)


def change_loss(logits: Tensor, masks: Tensor, weights: Tensor) -> Tensor:
    """Logits B x C x h x w against masks B x H x W, whose size is a multiple of theirs."""
    shares, known = shares_of(masks, masks.shape[-1] // logits.shape[-1])
    log_probabilities = F.log_softmax(logits.float(), dim=1)
    weighted = shares * weights[None, :, None, None]
    cross_entropy = -(weighted * log_probabilities).sum() / weighted.sum().clamp(min=1)
    changed = known - shares[:, NO_CHANGE]
    found = (1 - log_probabilities[:, NO_CHANGE].exp()) * known
    # One cell is added above and below: where nothing has changed and nothing is found, the overlap is whole.
    overlap = (2 * (found * changed).sum() + 1) / (found.sum() + changed.sum() + 1)
    return cross_entropy + OVERLAP_WEIGHT * (1 - overlap)
