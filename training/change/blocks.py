"""Building blocks of the networks."""

from torch import Tensor, nn
from torch.nn import functional as F


class ConvBlock(nn.Sequential):
    """Convolution, batch normalisation, ReLU."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int = 3, stride: int = 1, groups: int = 1):
        super().__init__(
            nn.Conv2d(channels_in, channels_out, kernel, stride, kernel // 2, groups=groups, bias=False),
            nn.BatchNorm2d(channels_out, momentum=0.03),
            nn.ReLU(inplace=True),
        )


class SeparableBlock(nn.Module):
    """A 3x3 convolution per channel, then a 1x1 convolution across channels; added to its input where shapes agree."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1):
        super().__init__()
        self.spatial = ConvBlock(channels_in, channels_in, 3, stride, groups=channels_in)
        self.mixing = ConvBlock(channels_in, channels_out, 1)
        self.residual = stride == 1 and channels_in == channels_out

    def forward(self, features: Tensor) -> Tensor:
        mixed = self.mixing(self.spatial(features))
        return features + mixed if self.residual else mixed


def enlarge(features: Tensor) -> Tensor:
    """Nearest-neighbour upsampling by 2."""
    return F.interpolate(features, scale_factor=2, mode="nearest")
