"""The network: a backbone, a top-down feature pyramid and one decoupled head per stride.

The backbone is that of NanoDet-g (CustomCspNet) up to stride 16, so that its weights, trained on COCO, can be
loaded (pretrained.py). Dense 3x3 convolutions nearly everywhere: they are what matrix units (AMX, tensor cores)
and OpenCV 4.6 run fastest, and nothing in the graph needs more than ONNX opset 11.
"""

import math
from dataclasses import dataclass
from typing import List, Tuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

STRIDES = (4, 8, 16)
"""Pixels of the input per cell of each prediction level, finest first."""

PRIOR_PROBABILITY = 0.01
"""Score of every anchor point before training, so that the first steps are not spent on background."""

DROPPED_CHANNELS = 0.1
"""Fraction of feature channels that training hides from a head (SpatialDropout, Tompson et al. 2015)."""

LEAK = 0.1
"""Slope of the backbone's ReLU below zero, as its pretrained weights expect it."""

PRIOR_BOX = (0.5, 0.5, 1.6, 1.1)
"""Raw (tx, ty, tw, th) of every anchor point before training: its cell's centre, 5 by 3 cells."""


@dataclass(frozen=True)
class Widths:
    """Channels of each part; the defaults give about 1.2 M parameters."""

    stem: int = 32  # twice as many at each stride from 4 on: 64, 128, 256
    pyramid: Tuple[int, int, int] = (32, 64, 96)  # at strides 4, 8, 16
    context: int = 128  # of one window of the pooled context
    deep: int = 0  # channels that enter the backbone's stage at stride 32, for context: no head there; 0: there is none

    @property
    def backbone(self) -> Tuple[int, int, int, int]:
        """Channels that the backbone gives at strides 4, 8, 16 and, if it is deep, 32."""
        return 2 * self.stem, 4 * self.stem, 8 * self.stem, 2 * self.deep


SIZES = {
    "small": Widths(pyramid=(32, 64, 64), context=64),
    "medium": Widths(pyramid=(48, 96, 128), deep=88),
    "base": Widths(pyramid=(48, 96, 128), deep=256),
}
"""Networks by name: 0.96 M, 1.97 M and 4.25 M parameters."""


class ConvBlock(nn.Sequential):
    """Convolution, batch normalisation, ReLU (leaky, where a slope is given)."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int = 3, stride: int = 1, slope: float = 0.0):
        super().__init__(
            nn.Conv2d(channels_in, channels_out, kernel, stride, kernel // 2, bias=False),
            nn.BatchNorm2d(channels_out, momentum=0.03),
            nn.LeakyReLU(slope, inplace=True) if slope else nn.ReLU(inplace=True),
        )


class PairBlock(nn.Module):
    """Two 3x3 convolutions of half the channels each, the second upon the first, side by side."""

    def __init__(self, channels: int):
        super().__init__()
        self.first = ConvBlock(channels, channels // 2, slope=LEAK)
        self.second = ConvBlock(channels // 2, channels // 2, slope=LEAK)

    def forward(self, features: Tensor) -> Tensor:
        first = self.first(features)
        return torch.cat([self.second(first), first], dim=1)


class CspStage(nn.Module):
    """A cross-stage partial network (Wang et al. 2019) as NanoDet-g has it; doubles the channels."""

    def __init__(self, channels: int, pairs: int, stride: int):
        super().__init__()
        self.enter = ConvBlock(channels, channels, stride=stride, slope=LEAK)
        self.pairs = nn.Sequential(*(PairBlock(channels) for _ in range(pairs)))
        self.leave = ConvBlock(channels, channels, slope=LEAK)

    def forward(self, features: Tensor) -> Tensor:
        entered = self.enter(features)
        return torch.cat([self.leave(self.pairs(entered)), entered], dim=1)


class PooledContext(nn.Module):
    """Spatial pyramid pooling (He et al. 2014) in YOLOv5's sequential form: windows of 5, 9 and 13 cells."""

    def __init__(self, channels_in: int, channels: int):
        super().__init__()
        self.reduce = ConvBlock(channels_in, channels, kernel=1)
        self.pool = nn.MaxPool2d(5, stride=1, padding=2)
        self.expand = ConvBlock(channels * 4, channels * 2, kernel=1)

    def forward(self, features: Tensor) -> Tensor:
        near = self.reduce(features)
        middle = self.pool(near)
        far = self.pool(middle)
        return self.expand(torch.cat([near, middle, far, self.pool(far)], dim=1))


def deep_stage(channels: int, entering: int) -> nn.Module:
    """From stride 16 to 32: NanoDet-g's own stage, or a narrow one after a projection to fewer channels."""
    if entering == channels:
        return CspStage(channels, pairs=3, stride=2)
    return nn.Sequential(ConvBlock(channels, entering, kernel=1, slope=LEAK), CspStage(entering, pairs=2, stride=2))


class Backbone(nn.Module):
    """Image to features at strides 4, 8 and 16, and at 32 where it is deep."""

    def __init__(self, widths: Widths):
        super().__init__()
        fine, middle, coarse, _ = widths.backbone
        self.stem = nn.Sequential(
            ConvBlock(3, widths.stem, stride=2, slope=LEAK), nn.MaxPool2d(3, stride=2, padding=1)
        )
        self.stride4 = CspStage(widths.stem, pairs=1, stride=1)
        self.stride8 = CspStage(fine, pairs=2, stride=2)
        self.stride16 = CspStage(middle, pairs=2, stride=2)
        self.stride32 = deep_stage(coarse, widths.deep) if widths.deep else None

    def forward(self, images: Tensor) -> List[Tensor]:
        fine = self.stride4(self.stem(images))
        middle = self.stride8(fine)
        coarse = self.stride16(middle)
        return [fine, middle, coarse] + ([self.stride32(coarse)] if self.stride32 else [])


class Pyramid(nn.Module):
    """Feature pyramid (Lin et al. 2017): coarse context flows down to the fine levels."""

    def __init__(self, widths: Widths):
        super().__init__()
        backbone, pyramid = widths.backbone, widths.pyramid
        top = nn.Sequential(
            PooledContext(backbone[3 if widths.deep else 2], widths.context), ConvBlock(2 * widths.context, pyramid[2], kernel=1)
        )
        if widths.deep:
            self.deep = top
            self.coarse = nn.Sequential(
                ConvBlock(backbone[2] + pyramid[2], pyramid[2], kernel=1), ConvBlock(pyramid[2], pyramid[2])
            )
        else:
            self.deep, self.coarse = None, top
        self.middle_in = ConvBlock(backbone[1] + pyramid[2], pyramid[1], kernel=1)
        self.middle = ConvBlock(pyramid[1], pyramid[1])
        self.fine_in = ConvBlock(backbone[0] + pyramid[1], pyramid[0], kernel=1)
        self.fine = ConvBlock(pyramid[0], pyramid[0])

    def forward(self, levels: List[Tensor]) -> List[Tensor]:
        fine, middle, coarse = levels[:3]
        coarse = self.coarse(beside(coarse, self.deep(levels[3])) if self.deep else coarse)
        middle = self.middle(self.middle_in(beside(middle, coarse)))
        fine = self.fine(self.fine_in(beside(fine, middle)))
        return [fine, middle, coarse]


def beside(features: Tensor, coarser: Tensor) -> Tensor:
    """Features and those of half the resolution (the larger half of an odd size), enlarged to nearest neighbours."""
    enlarged = F.interpolate(coarser, scale_factor=2, mode="nearest")
    if enlarged.shape[2:] != features.shape[2:]:
        enlarged = enlarged[:, :, : features.shape[2], : features.shape[3]]
    return torch.cat([features, enlarged], dim=1)


class Head(nn.Module):
    """Box and class predictions of one stride, from separate convolutions (YOLOX, Ge et al. 2021)."""

    def __init__(self, channels: int, class_count: int):
        super().__init__()
        self.box = nn.Sequential(ConvBlock(channels, channels), nn.Conv2d(channels, 4, 1))
        self.score = nn.Sequential(ConvBlock(channels, channels), nn.Conv2d(channels, class_count, 1))
        self.drop = nn.Dropout2d(DROPPED_CHANNELS)  # in training only
        nn.init.constant_(self.score[-1].bias, -math.log((1 - PRIOR_PROBABILITY) / PRIOR_PROBABILITY))
        with torch.no_grad():
            self.box[-1].bias.copy_(torch.tensor(PRIOR_BOX))

    def forward(self, features: Tensor) -> Tensor:
        """B x C x H x W features to B x HW x (4 + classes), rows first."""
        features = self.drop(features)
        return torch.cat([self.box(features), self.score(features)], dim=1).flatten(2).transpose(1, 2)


class Detector(nn.Module):
    """B x 3 x H x W normalised RGB to B x N x (4 + classes): (tx, ty, tw, th) and class logits.

    N runs over the anchor points of all strides, finest first, rows first. H and W are multiples of 16.
    """

    def __init__(self, class_count: int, widths: Widths = Widths()):
        super().__init__()
        self.class_count = class_count
        self.backbone = Backbone(widths)
        self.pyramid = Pyramid(widths)
        self.heads = nn.ModuleList(Head(channels, class_count) for channels in widths.pyramid)

    def forward(self, images: Tensor) -> Tensor:
        levels = self.pyramid(self.backbone(images))
        return torch.cat([head(level) for head, level in zip(self.heads, levels)], dim=1)


def anchor_points(height: int, width: int) -> Tuple[Tensor, Tensor]:
    """Cell indices (N x 2: grid_x, grid_y) and strides (N) of all anchor points of an input of that size."""
    grids, strides = [], []
    for stride in STRIDES:
        rows, columns = torch.meshgrid(
            torch.arange(height // stride), torch.arange(width // stride), indexing="ij"
        )
        grids.append(torch.stack([columns, rows], dim=-1).reshape(-1, 2).float())
        strides.append(torch.full((grids[-1].shape[0],), float(stride)))
    return torch.cat(grids), torch.cat(strides)


def decode_boxes(raw: Tensor, grid: Tensor, strides: Tensor) -> Tensor:
    """... x N x 4 raw (tx, ty, tw, th) to ... x N x 4 corners (x1, y1, x2, y2) in input pixels."""
    centres = (raw[..., :2] + grid) * strides[:, None]
    half_sizes = 0.5 * torch.exp(raw[..., 2:4].clamp(max=8.0)) * strides[:, None]
    return torch.cat([centres - half_sizes, centres + half_sizes], dim=-1)
