"""The networks: one encoder for both pictures, two decoders with weights of their own, final convolutions.

The structure is the thesis's (section 4.4, figure 4.3). `ChangeNetwork` at `Widths()` is change-small: separable
convolutions and one thing the thesis does not have, namely that a decoder's skip connections bring beside its own
picture's features how far they are from the other's, at the same place (`apart`) and from all that the other has near
that place (`beyond`): a registration leaves pixels. `ThesisNetwork` is the original, shaped like VGG-16.

Which pixels the warp could fill does not go into the encoder: its features depend on one picture alone and can be
kept. It decides at the very end (`Network.probabilities`), where what the two pictures show of a pixel outside of the warp
gives way to what is known without them (`surroundings.py`).
"""

from dataclasses import dataclass
from typing import Dict, List, Tuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .blocks import ConvBlock, SeparableBlock, enlarge
from .classes import CLASSES
from .surroundings import Prior, Surroundings, encoded_of

STRIDE = 32
"""Height and width of an input are multiples of this."""


@dataclass(frozen=True)
class Widths:
    """Channels of change-small's parts."""

    encoder: Tuple[int, ...] = (16, 48, 96, 192, 256)  # at strides 2, 4, 8, 16, 32
    blocks: Tuple[int, ...] = (1, 2, 3, 3, 2)  # separable convolutions at each stride
    decoder: Tuple[int, ...] = (24, 40, 72, 128)  # at strides 2, 4, 8, 16
    windows: Tuple[int, ...] = (0, 7, 5, 3)  # cells, odd, or 0, at these strides: within how many `beyond` looks for the same
    final: int = 32


class Encoder(nn.Module):
    """A picture to features at strides 2, 4, 8, 16 and 32."""

    def __init__(self, widths: Widths):
        super().__init__()
        stages, channels = [], 3
        for index, (width, blocks) in enumerate(zip(widths.encoder, widths.blocks)):
            enter = ConvBlock(channels, width, stride=2) if index == 0 else SeparableBlock(channels, width, stride=2)
            stages.append(nn.Sequential(enter, *(SeparableBlock(width, width) for _ in range(blocks))))
            channels = width
        self.stages = nn.ModuleList(stages)

    def forward(self, images: Tensor) -> List[Tensor]:
        levels = []
        for stage in self.stages:
            images = stage(images)
            levels.append(images)
        return levels


def highest_near(features: Tensor, window: int) -> Tensor:
    """The greatest value of each channel within window x window cells."""
    rows = F.max_pool2d(features, (1, window), 1, (0, window // 2))
    return F.max_pool2d(rows, (window, 1), 1, (window // 2, 0))


def beyond(own: Tensor, other: Tensor, window: int) -> Tensor:
    """How far features lie outside of all that the other picture's take on within window x window cells; 0 within."""
    above = F.relu(own - highest_near(other, window))
    below = F.relu(-highest_near(-other, window) - own)
    return above + below


class Decoder(nn.Module):
    """One picture's features, and how far they are from the other's, back to stride 2."""

    def __init__(self, widths: Widths):
        super().__init__()
        encoder, decoder = widths.encoder, widths.decoder
        self.windows = widths.windows
        self.enter = ConvBlock(2 * encoder[-1], decoder[-1], 1)
        joins, blocks = [], []
        for index in reversed(range(len(decoder))):
            here, below = decoder[index], decoder[max(index - 1, 0)]
            joins.append(ConvBlock(here + (3 if self.windows[index] else 2) * encoder[index], here, 1))
            blocks.append(SeparableBlock(here, below))  # narrowed before it is enlarged: four times fewer cells
        self.joins, self.blocks = nn.ModuleList(joins), nn.ModuleList(blocks)

    def forward(self, own: List[Tensor], other: List[Tensor], apart: List[Tensor]) -> Tensor:
        features = self.enter(torch.cat([own[-1], apart[-1]], dim=1))
        for step, (join, block) in enumerate(zip(self.joins, self.blocks)):
            level = len(self.joins) - 1 - step
            parts = [enlarge(features), own[level], apart[level]]
            if self.windows[level]:
                parts.append(beyond(own[level], other[level], self.windows[level]))
            features = block(join(torch.cat(parts, dim=1)))
        return features


class Network(nn.Module):
    """What both networks have in common. Pictures are B x 3 x H x W, normalised RGB, registered onto each other."""

    encoder: nn.Module
    first: nn.Module
    second: nn.Module
    logits_stride: int
    """Pixels of the input per cell of the logits: 1 or 2."""

    def encode(self, images: Tensor) -> List[Tensor]:
        """Features of pictures, each of one picture alone, finest first."""
        return self.encoder(images)

    def compare(self, first: List[Tensor], second: List[Tensor]) -> Tensor:
        """Logits (B x 10 x H / logits_stride x W / logits_stride) of pairs whose features are given."""
        raise NotImplementedError

    def forward(self, first: Tensor, second: Tensor) -> Tensor:
        """Logits of pairs of pictures, as compare's: what training sees."""
        # One batch for both, so that batch normalisation measures both pictures together.
        levels = self.encode(torch.cat([first, second]))
        count = len(first)
        return self.compare([level[:count] for level in levels], [level[count:] for level in levels])

    def probabilities(self, first: List[Tensor], second: List[Tensor], validity: Tensor) -> Tensor:
        """Probabilities (B x 10 x H x W) from features and validity (B x 1 x H x W: 1, or 0 where the warp had nothing).

        Softmax is taken in the logits' cells and then enlarged, which costs a quarter. A cell that has a share in an
        invalid pixel's result counts as not seen.
        """
        return self.enlarged(torch.softmax(self.refined(first, second, self.unseen_cells(validity)), dim=1))

    def unseen_cells(self, validity: Tensor) -> Tensor:
        """B x 1 x h x w in the logits' cells: 1 where a cell was not seen, else 0."""
        unseen = 1 - validity
        return F.max_pool2d(unseen, 4, stride=2, padding=1) if self.logits_stride == 2 else unseen

    def enlarged(self, found: Tensor) -> Tensor:
        """From the logits' cells to pixels."""
        if self.logits_stride == 1:
            return found
        return F.interpolate(found, scale_factor=self.logits_stride, mode="bilinear", align_corners=False)

    def refined(self, first: List[Tensor], second: List[Tensor], unseen: Tensor) -> Tensor:
        """Logits as compare's, where `unseen` (B x 1 x h x w, one value per cell) is 1 without what the pictures show there."""
        raise NotImplementedError

    def classify(self, images: Tensor) -> Tensor:
        """Logits of the class of each pixel's object, as coarse as compare's: what pretraining trains.

        It is change detection against nothing at all: the second decoder is told that all it sees is new.
        """
        raise NotImplementedError

    def begin_changes(self) -> None:
        """After pretraining: the first decoder begins with what the second has learnt."""
        self.first.load_state_dict(self.second.state_dict())

    def detect(self, first: Tensor, second: Tensor, validity: Tensor) -> Tensor:
        """Probabilities of pairs of pictures."""
        return self.probabilities(self.encode(first), self.encode(second), validity)


class ChangeNetwork(Network):
    """change-small at the default widths."""

    logits_stride = 2

    def __init__(self, widths: Widths = Widths(), refiners: int = 1):
        super().__init__()
        self.widths = widths
        self.encoder = Encoder(widths)
        self.first, self.second = Decoder(widths), Decoder(widths)
        self.final = nn.Sequential(
            ConvBlock(2 * widths.decoder[0], widths.final, 1),
            SeparableBlock(widths.final, widths.final),
            nn.Conv2d(widths.final, len(CLASSES), 1),
        )
        self.surroundings = Surroundings(widths.final, widths.encoder, refiners)
        self.objects = nn.Conv2d(widths.decoder[0], len(CLASSES), 1)  # in pretraining only

    def classify(self, images: Tensor) -> Tensor:
        levels = self.encode(images)
        nothing = [torch.zeros_like(level) for level in levels]
        return self.objects(self.second(levels, nothing, levels))

    def features(self, first: List[Tensor], second: List[Tensor]) -> Tensor:
        """Of a pair, at stride 2: what the last convolution makes logits of."""
        apart = [torch.abs(one - other) for one, other in zip(first, second)]
        decoded = torch.cat([self.first(first, second, apart), self.second(second, first, apart)], dim=1)
        return self.final[:-1](decoded)

    def compare(self, first: List[Tensor], second: List[Tensor]) -> Tensor:
        return self.final[-1](self.features(first, second))

    def refined(self, first: List[Tensor], second: List[Tensor], unseen: Tensor) -> Tensor:
        features = self.features(first, second)
        return self.surroundings(features, self.final[-1](features), unseen, encoded_of(first, second))


def convolutions(channels_in: int, channels_out: int, count: int) -> nn.Sequential:
    """`count` 3x3 convolutions with normalisation and ReLU."""
    widths = [channels_in] + [channels_out] * count
    return nn.Sequential(*(ConvBlock(before, after) for before, after in zip(widths, widths[1:])))


class ThesisEncoder(nn.Module):
    """VGG-16's convolutions, then three more; each block's features as they are before its pooling (strides 1 to 16)."""

    def __init__(self, base: int):
        super().__init__()
        widths = [base, 2 * base, 4 * base, 8 * base, 8 * base]
        self.blocks = nn.ModuleList(
            convolutions(before, after, count) for before, after, count in zip([3] + widths, widths, (2, 2, 3, 3, 3))
        )
        self.deepest = convolutions(widths[-1], widths[-1], 3)

    def forward(self, images: Tensor) -> List[Tensor]:
        levels = []
        for block in self.blocks:
            levels.append(block(images))
            images = F.max_pool2d(levels[-1], 2)
        return levels + [self.deepest(images)]


class ThesisDecoder(nn.Module):
    """Symmetric to VGG-16: per block one transposed convolution, the skip connection, three convolutions."""

    def __init__(self, base: int):
        super().__init__()
        widths = [8 * base, 8 * base, 8 * base, 4 * base, 2 * base, base]
        self.ups = nn.ModuleList(nn.ConvTranspose2d(above, here, 2, 2) for above, here in zip(widths, widths[1:]))
        self.blocks = nn.ModuleList(convolutions(2 * here, here, 3) for here in widths[1:])

    def forward(self, levels: List[Tensor]) -> Tensor:
        features = levels[-1]
        for up, block, skip in zip(self.ups, self.blocks, reversed(levels[:-1])):
            features = block(torch.cat([up(features), skip], dim=1))
        return features


class ThesisNetwork(Network):
    """The thesis's network: 64 channels in the first block, as VGG-16 has; a smaller `base` only serves tests.

    Batch normalisation is ours: the thesis began with ImageNet's weights, which this can do without.
    """

    logits_stride = 1

    def __init__(self, base: int = 64):
        super().__init__()
        self.encoder = ThesisEncoder(base)
        self.first, self.second = ThesisDecoder(base), ThesisDecoder(base)
        self.final = nn.Sequential(
            ConvBlock(2 * base, base), ConvBlock(base, base), nn.Conv2d(base, len(CLASSES), 3, padding=1)
        )
        self.prior = Prior()
        self.objects = nn.Conv2d(base, len(CLASSES), 1)  # in pretraining only

    def classify(self, images: Tensor) -> Tensor:
        return self.objects(self.second(self.encode(images)))

    def compare(self, first: List[Tensor], second: List[Tensor]) -> Tensor:
        return self.final(torch.cat([self.first(first), self.second(second)], dim=1))

    def refined(self, first: List[Tensor], second: List[Tensor], unseen: Tensor) -> Tensor:
        return self.prior(self.compare(first, second), unseen)


def widened(state: Dict[str, Tensor], network: Network) -> Dict[str, Tensor]:
    """Weights of a network whose convolutions saw fewer channels, for `network`: what it sees besides begins at 0."""
    grown = dict(state)
    for name, here in network.state_dict().items():
        before = state.get(name)
        if before is None or before.dim() != 4 or before.shape[1] >= here.shape[1] or before.shape[0] != here.shape[0]:
            continue
        grown[name] = torch.zeros_like(here)
        grown[name][:, : before.shape[1]] = before
    return grown


ARCHITECTURES = {"change-small": ChangeNetwork, "thesis": ThesisNetwork}
"""By the name that --architecture takes."""
