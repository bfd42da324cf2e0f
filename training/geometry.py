"""What sticks draw in space, as channels over time and as one summary of the whole window.

All of it is computed inside the model's graph from the raw sticks, so that no service can prepare
its input otherwise than training did. Few operations matter more here than few multiplications:
each costs about a microsecond, whatever its size.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from services.classifier.window import MODEL_RATE_HZ

STRIDE = 2
"""Channels have half the model's rate: thumbs do nothing above 12 Hz but tremble."""
STEP_S = STRIDE / MODEL_RATE_HZ
SMOOTH_TAPS = 9
"""Samples: 0.18 s, above tremor's period, below the quickest gesture's."""
TURN_TAPS = (7, 21)
"""Steps: rates of turn over 0.28 s and over 0.84 s."""
STILL = 0.1
"""Below this deflection a direction is mostly noise."""
BACK = 1e-4
"""Keeps the turn of a stick that is pulled straight back from depending on a rounding error."""
WAVES = 8
"""Cosines over a window that a summary is made of: eight half periods, four whole ones."""
SIGNED = 10
"""The first signals of a summary are signed: their coefficients' sizes are features as well."""


def _length(x: Tensor, floor: float) -> Tensor:
    """Lengths (B, 1, T) of vectors (B, C, T), smooth at 0."""
    return torch.sqrt((x * x).sum(1, keepdim=True) + floor)


class Geometry(nn.Module):
    """Sticks as geometry that does not change when the whole motion is turned about z."""

    waves: Tensor
    kernels: Tensor

    CHANNELS = 16
    STICKS = (4, 5, 2, 14)
    """Which of the channels are the sticks themselves: vx, vy, vz, wz."""
    SUMMARY = 2 * (WAVES + 1) * (15 + SIGNED) + 20

    def __init__(self) -> None:
        super().__init__()
        waves = math.pi * torch.arange(WAVES + 1, dtype=torch.float32)
        self.register_buffer("waves", waves[None, None, :, None], persistent=False)
        longest = max(TURN_TAPS)
        # Sums over each of TURN_TAPS of turns, and of how many of them there are.
        kernels = torch.zeros(2 * len(TURN_TAPS), 2, longest)
        for index, taps in enumerate(TURN_TAPS):
            inside = slice((longest - taps) // 2, (longest + taps) // 2)
            kernels[2 * index, 0, inside] = 1.0
            kernels[2 * index + 1, 1, inside] = 1.0
        self.register_buffer("kernels", kernels, persistent=False)

    def forward(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Geometry of windows; inputs as in services/classifier/model.py.

        Returns:
            Channels (B, CHANNELS, T / STRIDE), 0 where padded; mask (B, 1, T / STRIDE), 1 where
            not; summary (B, features).
        """
        real = (torch.arange(sticks.shape[1]) < lengths.unsqueeze(1)).to(sticks.dtype)
        x = (sticks * real.unsqueeze(2)).transpose(1, 2)
        real = real.unsqueeze(1)
        v, raw, mask = self._velocity(x, times_s, real, full_yaw_radps)
        count = mask.sum(2, keepdim=True)
        vx, vy, vz = v[:, 0:1], v[:, 1:2], v[:, 2:3]
        speed = _length(v[:, :2], 1e-8) * mask
        travel = _length(v, 1e-8) * mask
        total = travel.sum(2, keepdim=True).clamp(min=0.5)
        level = total / count + 0.02

        # The chord from the first place to the last is the x axis of all that follows.
        chord = v[:, :2].sum(2, keepdim=True)
        chord_length = _length(chord, 1e-6)
        axis = chord / chord_length
        c, s = axis[:, 0:1], axis[:, 1:2]
        along, across = c * vx + s * vy, c * vy - s * vx

        step = self._turns(v[:, :2], speed) * mask
        by_way = speed / speed.sum(2, keepdim=True).clamp(min=0.1)
        by_time = mask / count
        heading = torch.cumsum(step, 2)
        heading = (heading - (heading * by_way).sum(2, keepdim=True)) * mask
        sums = F.conv1d(torch.cat([step, mask], 1), self.kernels, padding=max(TURN_TAPS) // 2)
        turn = sums[:, 0::2] / sums[:, 1::2].clamp(min=1.0) * mask / STEP_S
        relative = torch.cat([along, across, vz, speed, raw[:, :2]], 1) / level
        wz = raw[:, 2:3]
        path = torch.cumsum(torch.cat([along, across, vz], 1), 2) / total
        path = (path - (path * by_time).sum(2, keepdim=True)) * mask

        channels = torch.cat(
            [
                relative,
                speed,
                heading / math.pi,
                turn,
                turn[:, :1] / (speed + STILL) * level,
                path * 4.0,
                wz,
                mask * times_s[:, ::STRIDE].unsqueeze(1) / 4.0,
            ],
            1,
        )
        signals = torch.cat(
            [
                heading,
                turn,
                relative,
                wz,
                heading * heading,
                F.relu(turn),
                relative[:, 2:3].abs(),
                wz * wz,
            ],
            1,
        )
        shares = torch.stack([by_way, by_time], 1)
        summary = self._summary(signals, shares, step, count, total, chord_length)
        return channels, mask, summary

    @staticmethod
    def _velocity(
        x: Tensor, times_s: Tensor, real: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Smoothed sticks (B, 4, T) in the frame of the first heading, and as the pad sends them.

        Returns:
            vx vy vz (B, 3, T / STRIDE) in a frame that does not turn with the vehicle; vx and vy as
            they are with the yaw rate in rad/s; the mask.
        """
        vx, vy = x[:, 0:1], x[:, 1:2]
        turning = x[:, 3:] * full_yaw_radps[:, None, None]
        # A stick is held until the next one, so a step turns by the stick at its beginning.
        steps = F.pad(turning[:, 0, :-1] * (times_s[:, 1:] - times_s[:, :-1]), (1, 0))
        yaw = torch.cumsum(steps, 1).unsqueeze(1)
        c, s = torch.cos(yaw), torch.sin(yaw)
        straight = [c * vx - s * vy, s * vx + c * vy, x[:, 2:3]]
        stacked = torch.cat([*straight, x[:, :2], turning, real], 1)
        means = F.avg_pool1d(stacked, SMOOTH_TAPS, STRIDE, SMOOTH_TAPS // 2)
        mask = real[:, :, ::STRIDE]
        means = means[:, :6] / means[:, 6:].clamp(min=1.0 / SMOOTH_TAPS) * mask
        return means[:, :3], means[:, 3:], mask

    @staticmethod
    def _turns(v: Tensor, speed: Tensor) -> Tensor:
        """Angles (B, 1, T) from each direction to the next; of a resting stick about nothing."""
        a, b = v[:, :, :-1], v[:, :, 1:]
        dot = (a * b).sum(1, keepdim=True)
        cross = a[:, 0:1] * b[:, 1:2] - a[:, 1:2] * b[:, 0:1]
        energy = speed[:, :, :-1] * speed[:, :, 1:]
        # The tangent of half the angle: no quadrants, and going straight back turns to no side.
        half = torch.atan(cross / (energy + dot + BACK))
        turns = 2.0 * half * energy / (energy + STILL * STILL)
        return F.pad(turns, (1, 0))

    def _summary(
        self,
        signals: Tensor,
        shares: Tensor,
        step: Tensor,
        count: Tensor,
        total: Tensor,
        chord: Tensor,
    ) -> Tensor:
        """Features (B, n) of whole windows: cosine coefficients of each signal, and sizes.

        Args:
            signals: (B, S, T), the first `SIGNED` of them signed.
            shares: (B, 2, 1, T) of each step in the way and in the time; each sums to 1.
            step: (B, 1, T) turns.
            count: (B, 1, 1) steps.
            total: (B, 1, 1) way.
            chord: (B, 1, 1) its end's distance from its beginning.
        """
        middle = torch.cumsum(shares, 3) - 0.5 * shares
        waves = (torch.cos(middle * self.waves) * shares).flatten(1, 2)
        coefficients = torch.matmul(waves, signals.transpose(1, 2))
        means = coefficients[:, WAVES + 1]
        seconds = count[:, :, 0] * STEP_S
        left = means[:, 11:13] * seconds
        right = left - means[:, 1:3] * seconds
        one_way = torch.cat([torch.minimum(left, right), torch.maximum(left, right)], 1)
        sizes = torch.cat(
            [
                one_way + 0.02,
                coefficients[:, 0, 10:11] + 1e-4,
                total[:, :, 0],
                total[:, :, 0] / count[:, :, 0],
                seconds,
                chord[:, :, 0] / total[:, :, 0] + 0.01,
                step.abs().sum(2) + 0.01,
            ],
            1,
        )
        return torch.cat(
            [
                coefficients.flatten(1),
                coefficients[:, :, :SIGNED].abs().flatten(1),
                # Padding is 0, so it must count where there is none as well.
                signals[:, :3].amax(2).clamp(min=0.0),
                signals[:, :3].amin(2).clamp(max=0.0),
                one_way,
                torch.log(sizes),
            ],
            1,
        )
