"""What lies around a cell decides with it: a change is rarely alone, and where nothing was seen only its surroundings can say.

The network decides on every cell by what two pictures show there. That leaves two things unused. Objects are wholes: cells
beside a sure change are likelier to have changed than those on an empty road, and a faint change amid none is likelier an
error. And where the registered earlier picture shows nothing, what stands there now (a car, the road, the sky) and what has
changed beside it say how likely a change is. A `ContextRefiner` learns both, after the network and with it held fixed, on
streets that the network has not seen: on its own it is too sure. Several refiners that learnt apart err less together.
"""

import copy
from typing import Dict, List, Sequence, Tuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .blocks import ConvBlock, SeparableBlock, enlarge
from .classes import CLASSES, NO_CHANGE

WIDTHS: Tuple[int, ...] = (16, 32, 48, 48, 48)
"""Channels at strides 2, 4, 8, 16 and 32 of the input."""

KNOWN, KNOWN_LEVELS = 24, (2, 3)
"""Channels that the encoder's features become, and of which levels: strides 8 and 16."""

DROPOUT = 0.1
"""Share of the channels that a training step hides: there are few streets to learn from."""

UNSEEN_CHANGE = 0.1
"""Probability of a change, of all classes alike, that untrained `Surroundings` give a cell that was not seen."""


def per_class(weights: Tensor) -> nn.Conv2d:
    """A 1x1 convolution of one channel to one per class (multiplication with a channel is no operator that all engines share)."""
    convolution = nn.Conv2d(1, len(CLASSES), 1, bias=False)
    with torch.no_grad():
        convolution.weight.copy_(weights.reshape(-1, 1, 1, 1))
    return convolution


def prior_logits() -> Tensor:
    """Logits of a cell of which nothing is known."""
    change = UNSEEN_CHANGE / (len(CLASSES) - 1)
    probabilities = torch.full((len(CLASSES),), change)
    probabilities[NO_CHANGE] = 1 - UNSEEN_CHANGE
    return probabilities.log()


EARLIER_NAMES = ((".judges.", ".refiners."), (".verdict.", ".correction."))
"""Parts of weights' names in files of earlier versions, and as they are now."""


def with_present_names(weights: Dict[str, Tensor]) -> Dict[str, Tensor]:
    """Weights by name, of a checkpoint or an export of any version."""
    for earlier, present in EARLIER_NAMES:
        weights = {name.replace(earlier, present): value for name, value in weights.items()}
    return weights


def encoded_of(first: List[Tensor], second: List[Tensor]) -> Dict[int, Tensor]:
    """What `Surroundings` gets of the encoder's features of both pictures, by level."""
    return {level: torch.cat([first[level], second[level]], dim=1) for level in KNOWN_LEVELS}


class Prior(nn.Module):
    """Logits as they are where a cell was seen; where it was not, those of `prior_logits`."""

    def __init__(self):
        super().__init__()
        self.seen = per_class(torch.ones(len(CLASSES)))
        self.unseen = per_class(prior_logits()).requires_grad_(False)

    def forward(self, logits: Tensor, unseen: Tensor) -> Tensor:
        return logits * self.seen(1 - unseen) + self.unseen(unseen)


class ContextRefiner(nn.Module):
    """Features (B x F x h x w) and what was not seen (B x 1 x h x w, 0 or 1), at stride 2, to how much likelier a change is.

    `encoded` are the encoder's features of both pictures: they say what stands there, whether it has changed or not. The correction
    (B x 2 x h x w) is a difference of log-odds for cells that were seen and one for others.
    """

    def __init__(self, features: int, encoder: Tuple[int, ...]):
        super().__init__()
        self.enter = ConvBlock(features + 1, WIDTHS[0], 1)
        self.hidden = nn.Dropout2d(DROPOUT)
        self.known = nn.ModuleDict({str(level): ConvBlock(2 * encoder[level], KNOWN, 1) for level in KNOWN_LEVELS})
        self.join = nn.ModuleDict({str(level): ConvBlock(WIDTHS[level] + KNOWN, WIDTHS[level], 1) for level in KNOWN_LEVELS})
        self.down = nn.ModuleList(SeparableBlock(before, after, 2) for before, after in zip(WIDTHS, WIDTHS[1:]))
        self.deepest = SeparableBlock(WIDTHS[-1], WIDTHS[-1])
        self.up = nn.ModuleList(
            nn.Sequential(ConvBlock(below + here, here, 1), SeparableBlock(here, here))
            for below, here in zip(WIDTHS[:1:-1], WIDTHS[-2:0:-1])
        )
        self.correction = nn.Conv2d(WIDTHS[1], 2, 1)
        with torch.no_grad():
            self.correction.weight.zero_()
            self.correction.bias.zero_()

    def forward(self, features: Tensor, unseen: Tensor, encoded: Dict[int, Tensor]) -> Tensor:
        levels = [self.enter(torch.cat([self.hidden(features), unseen], dim=1))]
        for level, block in enumerate(self.down, 1):
            around = block(levels[-1])
            if level in KNOWN_LEVELS:
                known = self.known[str(level)](self.hidden(encoded[level]))
                around = self.join[str(level)](torch.cat([around, known], dim=1))
            levels.append(around)
        around = self.deepest(levels[-1])
        for block, level in zip(self.up, levels[-2:0:-1]):
            around = block(torch.cat([enlarge(around), level], dim=1))
        return F.interpolate(self.correction(around), scale_factor=2, mode="bilinear", align_corners=False)


class Surroundings(nn.Module):
    """Logits as the network alone has them to logits that know their surroundings: the corrections of all refiners are added."""

    def __init__(self, features: int, encoder: Tuple[int, ...], refiners: int = 1):
        super().__init__()
        self.prior = Prior()
        self.refiners = nn.ModuleList(ContextRefiner(features, encoder) for _ in range(refiners))
        self.weigh = nn.Conv2d(2, len(CLASSES), 1, bias=False).requires_grad_(False)
        with torch.no_grad():
            self.weigh.weight.zero_()[NO_CHANGE] = -1

    def forward(self, features: Tensor, logits: Tensor, unseen: Tensor, encoded: Dict[int, Tensor]) -> Tensor:
        corrections = [refiner(features, unseen, encoded) for refiner in self.refiners]
        correction = corrections[0]
        for other in corrections[1:]:
            correction = correction + other
        return self.prior(logits, unseen) + self.weigh(correction * torch.cat([1 - unseen, unseen], dim=1))


@torch.no_grad()
def ensemble_of(several: Sequence[Surroundings]) -> Surroundings:
    """Several that learnt apart, with the same network, as one that gives the mean of their logits."""
    joined = copy.deepcopy(several[0])
    joined.prior.seen.weight.copy_(torch.stack([one.prior.seen.weight for one in several]).mean(dim=0))
    joined.refiners = nn.ModuleList(copy.deepcopy(refiner) for one in several for refiner in one.refiners)
    for refiner in joined.refiners:
        refiner.correction.weight.div_(len(several))
        refiner.correction.bias.div_(len(several))
    return joined
