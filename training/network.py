"""The network of the thesis, four convolutions and two GRUs, on what the sticks draw in space.

One graph from raw sticks to probabilities: everything the network sees is computed inside, so that
no service can prepare its input otherwise than training did.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

RATE_HZ = 50.0
CHANNELS = 12
SMOOTH_TAPS = 9
"""0.18 s: above tremor's period, below the quickest gesture's."""
TURN_TAPS = 15
STILL = 0.1
"""Below this deflection a direction is mostly noise."""


def _smoothed(x: Tensor, mask: Tensor, taps: int) -> Tensor:
    """Running means over time of (B, C, T), which leave padding out (mask (B, 1, T))."""
    share = F.avg_pool1d(mask, taps, 1, taps // 2)
    mean = F.avg_pool1d(x * mask, taps, 1, taps // 2)
    return mean / share.clamp(min=1.0 / taps) * mask


class Geometry(nn.Module):
    """Sticks as geometry that does not change when the whole motion is turned about z.

    Input sticks (B, T, 3) and mask (B, 1, T); output (B, CHANNELS, T), 0 where padded.
    """

    def forward(self, sticks: Tensor, mask: Tensor) -> Tensor:
        """The channels: velocity and path in the frame of the chord, heading, turn, time, climb."""
        v = _smoothed(sticks.transpose(1, 2), mask, SMOOTH_TAPS)
        vx, vy, vz = v[:, 0:1], v[:, 1:2], v[:, 2:3]
        count = mask.sum(2, keepdim=True)
        speed = torch.sqrt(vx * vx + vy * vy + 1e-12) * mask
        # The chord from the first place to the last is the x axis of all that follows.
        chord_x, chord_y = vx.sum(2, keepdim=True), vy.sum(2, keepdim=True)
        chord = torch.sqrt(chord_x * chord_x + chord_y * chord_y + 1e-6)
        c, s = chord_x / chord, chord_y / chord
        along, across = c * vx + s * vy, c * vy - s * vx
        # Heading, unwrapped, as a sum of small turns; those of a resting stick count for nothing.
        ax, ay = vx[:, :, :-1], vy[:, :, :-1]
        bx, by = vx[:, :, 1:], vy[:, :, 1:]
        dot = ax * bx + ay * by
        step = torch.atan2(ax * by - ay * bx, dot + 1e-9)
        energy = speed[:, :, :-1] * speed[:, :, 1:]
        step = F.pad(step * energy / (energy + STILL * STILL), (1, 0)) * mask
        heading = torch.cumsum(step, 2) * mask
        heading = (heading - heading.sum(2, keepdim=True) / count) * mask
        turn = _smoothed(step, mask, TURN_TAPS) * RATE_HZ
        length = torch.sqrt((v * v).sum(1, keepdim=True) + 1e-12) * mask
        total = length.sum(2, keepdim=True).clamp(min=1.0)
        path = torch.cumsum(torch.cat([along, across, vz], 1), 2) * mask
        path = (path - path.sum(2, keepdim=True) / count) / total * mask
        level = (total / count).clamp(min=0.05)
        elapsed = torch.cumsum(mask, 2) / (RATE_HZ * 4.0) * mask
        climb = vz.abs().sum(2, keepdim=True) / total * mask
        return torch.cat(
            [
                along / level,
                across / level,
                vz / level,
                speed,
                heading / math.pi,
                turn,
                turn / speed.clamp(min=STILL) * level,
                path * 4.0,
                elapsed,
                climb,
            ],
            1,
        )


class _Convolution(nn.Module):
    """Conv1d, batch norm, LeakyReLU; padding stays 0, so its length changes nothing."""

    def __init__(self, inputs: int, outputs: int, taps: int, stride: int) -> None:
        super().__init__()
        self.conv = nn.Conv1d(inputs, outputs, taps, stride, padding=taps // 2, bias=False)
        self.norm = nn.BatchNorm1d(outputs)
        self.stride = stride

    def forward(self, x: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        mask = mask[:, :, :: self.stride]
        return F.leaky_relu(self.norm(self.conv(x)), 0.1) * mask, mask


class CnnGru(nn.Module):
    """Four convolutions, two GRUs, pooling over what is not padding, and logits.

    Args:
        classes: how many primitives.
        width: channels of the convolutions and units of the GRUs.
        dropout: of both dropout layers.
    """

    def __init__(self, classes: int, width: int = 64, dropout: float = 0.25) -> None:
        super().__init__()
        self.geometry = Geometry()
        self.standardise = nn.BatchNorm1d(CHANNELS)
        self.convolutions = nn.ModuleList(
            [
                _Convolution(CHANNELS, width, 7, 1),
                _Convolution(width, width, 5, 2),
                _Convolution(width, width, 5, 2),
                _Convolution(width, width, 3, 1),
            ]
        )
        self.dropout = nn.Dropout(dropout)
        self.gru = nn.GRU(width, width, num_layers=2, batch_first=True)
        self.head_dropout = nn.Dropout(dropout)
        self.head = nn.Linear(3 * width, classes)

    def forward(self, sticks: Tensor, lengths: Tensor) -> Tensor:
        """Logits (B, classes) of sticks (B, T, 3) of which `lengths` (B,) samples are real."""
        steps = torch.cumsum(torch.ones_like(sticks[:, :, 0]), 1)
        mask = (steps <= lengths.unsqueeze(1).to(sticks.dtype)).to(sticks.dtype).unsqueeze(1)
        with torch.no_grad():
            x = self.geometry(sticks, mask)
        x = self.standardise(x) * mask
        for convolution in self.convolutions:
            x, mask = convolution(x, mask)
        states, _ = self.gru(self.dropout(x.transpose(1, 2)))
        mask = mask.transpose(1, 2)
        count = mask.sum(1)
        mean = (states * mask).sum(1) / count
        largest = (states * mask - 2.0 * (1.0 - mask)).max(1).values
        # The state at the last real step: the only one whose mask is not followed by another.
        after = F.pad(mask[:, 1:], (0, 0, 0, 1))
        last = (states * (mask - after)).sum(1)
        return self.head(self.head_dropout(torch.cat([last, mean, largest], 1)))  # type: ignore[no-any-return]


class Probabilities(nn.Module):
    """A network with its temperature and the softmax: what is exported."""

    def __init__(self, network: CnnGru, temperature: float) -> None:
        super().__init__()
        self.network = network
        self.temperature = temperature

    def forward(self, sticks: Tensor, lengths: Tensor) -> Tensor:
        """Probabilities (B, classes)."""
        return torch.softmax(self.network(sticks, lengths) / self.temperature, 1)
