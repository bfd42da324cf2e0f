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
WAVES = 6
"""Cosines over a window that a summary is made of: six half periods."""
PLANES = 3
"""In which turns are measured: the sticks' horizontal one, and the flown path's two."""
SIGNALS, SIGNED = 28, 17
"""A summary's signals; the first are signed: their coefficients' sizes are features as well."""
LAG_S, LAG_TAPS = 0.4, 40
"""A vehicle's speed follows its stick with about this time constant (tum plant 0.3 to 0.4 s)."""
UP_PER_AHEAD = 0.5
"""Speed of full stick upwards, of that ahead (tum plant; about as much on the ardrone)."""


def _length(x: Tensor, floor: float) -> Tensor:
    """Lengths (B, 1, T) of vectors (B, C, T), smooth at 0."""
    return torch.sqrt((x * x).sum(1, keepdim=True) + floor)


class Geometry(nn.Module):
    """Sticks as geometry that does not change when the whole motion is turned about z."""

    waves: Tensor
    kernels: Tensor
    quarter: Tensor
    lag: Tensor

    CHANNELS = 22
    STICKS = (5, 6, 3, 20)
    """Which of the channels are the sticks themselves: vx, vy, vz, wz."""
    SUMMARY = 2 * (WAVES + 1) * (SIGNALS + SIGNED) + 16 * PLANES + 5

    def __init__(self) -> None:
        super().__init__()
        waves = math.pi * torch.arange(WAVES + 1, dtype=torch.float32)
        self.register_buffer("waves", waves[None, None, :, None], persistent=False)
        # A quarter turn to the left.
        quarter = torch.tensor([[0.0, -1.0], [1.0, 0.0]])
        self.register_buffer("quarter", quarter, persistent=False)
        longest = max(TURN_TAPS)
        # Sums of turns in each plane over each of TURN_TAPS, and of how many of them there are.
        count = PLANES * len(TURN_TAPS)
        kernels = torch.zeros(2 * count, PLANES + 1, longest)
        for scale, taps in enumerate(TURN_TAPS):
            inside = slice((longest - taps) // 2, (longest + taps) // 2)
            for plane in range(PLANES):
                row = PLANES * scale + plane
                kernels[row, plane, inside] = 1.0
                kernels[count + row, PLANES, inside] = 1.0
        decay = torch.exp(-STEP_S / LAG_S * torch.arange(LAG_TAPS - 1.0, -1.0, -1.0))
        gains = torch.tensor([1.0, 1.0, 1.0, UP_PER_AHEAD]) * (1.0 - math.exp(-STEP_S / LAG_S))
        self.register_buffer("lag", torch.diag(gains)[:, :, None] * decay, persistent=False)
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
        vx, vy, vz = torch.split(v, 1, 1)
        travel = _length(v, 1e-8) * mask
        total = travel.sum(2, keepdim=True).clamp(min=0.5)
        level = total / count + 0.02

        # The chord from the first place to the last is the x axis of all that follows.
        flat = v[:, :2]
        chord = flat.sum(2, keepdim=True)
        chord_length = _length(chord, 1e-6)
        axis = chord / chord_length
        axes = torch.cat([axis, torch.matmul(self.quarter, axis), self._main_axis(flat, axis)], 2)
        turned = torch.matmul(axes.transpose(1, 2), flat)
        ahead = turned[:, 2:]
        local = torch.cat([turned, vz], 1)

        # Shapes lie in the horizontal plane, or in the vertical one that most of the motion is in.
        # Pilots shape what the vehicle flies, and their sticks lead it.
        flown = F.conv1d(F.pad(torch.cat([flat, ahead, vz], 1), (LAG_TAPS - 1, 0)), self.lag)
        fx, fy, f_ahead, f_up = torch.split(flown, 1, 1)
        planes = torch.cat([vx, fx, f_ahead, vy, fy, f_up], 1)
        squares = planes * planes
        speed = torch.sqrt(squares[:, :3] + squares[:, 3:] + 1e-8) * mask
        step = self._turns(planes, speed) * mask
        by_way = travel / travel.sum(2, keepdim=True).clamp(min=0.1)
        by_time = mask / count
        heading = torch.cumsum(step, 2)
        heading = (heading - (heading * by_way).sum(2, keepdim=True)) * mask
        sums = F.conv1d(torch.cat([step, mask], 1), self.kernels, padding=max(TURN_TAPS) // 2)
        turn = sums[:, :6] / sums[:, 6:].clamp(min=1.0) * mask / STEP_S
        flat_speed = speed[:, :1]
        raw, wz = torch.split(raw, [2, 1], 1)
        relative = torch.cat([local, flat_speed, raw], 1) / level
        path = torch.cumsum(local, 2) / total
        path = (path - (path * by_time).sum(2, keepdim=True)) * mask

        channels = torch.cat(
            [
                relative,
                flat_speed,
                heading / math.pi,
                turn[:, :4],
                turn[:, :1] / (flat_speed + STILL) * level,
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
                relative[:, 3:4].abs(),
                wz * wz,
            ],
            1,
        )
        # Of the horizontal motion, the share along its main axis: 1 in a vertical plane.
        in_plane = (ahead * ahead).sum(2, keepdim=True) / (
            (flat_speed * flat_speed).sum(2, keepdim=True) + 0.01
        )
        sizes = torch.cat(
            [
                total,
                level,
                count * STEP_S,
                chord_length / total + 0.01,
                step.abs().sum(2, keepdim=True) + 0.01,
                (1.0 - in_plane).clamp(min=0.0) + 0.01,
            ],
            1,
        ).squeeze(2)
        summary = self._summary(signals, torch.stack([by_way, by_time], 1), sizes)
        return channels, mask, summary

    def _velocity(
        self, x: Tensor, times_s: Tensor, real: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Smoothed sticks (B, 4, T) in the frame of the first heading, and as the pad sends them.

        Returns:
            vx vy vz (B, 3, T / STRIDE) in a frame that does not turn with the vehicle; vx and vy as
            they are with the yaw rate in rad/s; the mask.
        """
        flat, vz, wz = torch.split(x, [2, 1, 1], 1)
        turning = wz * full_yaw_radps[:, None, None]
        # A stick is held until the next one, so a step turns by the stick at its beginning.
        held = turning[:, 0, :-1] * (times_s[:, 1:] - times_s[:, :-1])
        yaw = torch.cumsum(F.pad(held, (1, 0)), 1).unsqueeze(1)
        straight = torch.cos(yaw) * flat + torch.sin(yaw) * torch.matmul(self.quarter, flat)
        stacked = torch.cat([straight, vz, flat, turning, real], 1)
        means = F.avg_pool1d(stacked, SMOOTH_TAPS, STRIDE, SMOOTH_TAPS // 2)
        mask = real[:, :, ::STRIDE]
        v, raw, share = torch.split(means, [3, 3, 1], 1)
        scale = mask / share.clamp(min=1.0 / SMOOTH_TAPS)
        return v * scale, raw * scale, mask

    @staticmethod
    def _main_axis(v: Tensor, guess: Tensor) -> Tensor:
        """The direction (B, 2, 1) that most of a horizontal motion (B, 2, T) is along.

        By powers of the matrix of second moments, from a guess that also gives it its sign.
        """
        moments = torch.matmul(v, v.transpose(1, 2))
        moments = moments / (moments[:, 0:1, 0:1] + moments[:, 1:2, 1:2] + 1e-6)
        squared = torch.matmul(moments, moments)
        axis = torch.matmul(torch.matmul(squared, squared), guess)
        return axis / _length(axis, 1e-9)

    @staticmethod
    def _turns(planes: Tensor, speed: Tensor) -> Tensor:
        """Angles (B, PLANES, T) from each direction to the next; of a resting stick about nothing.

        Args:
            planes: (B, 2 PLANES, T) the first component in each of the planes, then the second.
            speed: (B, PLANES, T) in each.
        """
        a, b = planes[:, :, :-1], planes[:, :, 1:]
        ax, ay = torch.split(a, PLANES, 1)
        bx, by = torch.split(b, PLANES, 1)
        energy = speed[:, :, :-1] * speed[:, :, 1:]
        # The tangent of half the angle: no quadrants, and going straight back turns to no side.
        half = torch.atan((ax * by - ay * bx) / (energy + ax * bx + ay * by + BACK))
        return F.pad(half * energy / (0.5 * energy + 0.5 * STILL * STILL), (1, 0))

    def _summary(self, signals: Tensor, shares: Tensor, sizes: Tensor) -> Tensor:
        """Features (B, SUMMARY) of whole windows: cosine coefficients of each signal, and sizes.

        Args:
            signals: (B, SIGNALS, T), the first `SIGNED` of them signed.
            shares: (B, 2, 1, T) of each step in the way and in the time; each sums to 1.
            sizes: (B, n) positive, over `n` orders of magnitude; the third is seconds.
        """
        middle = torch.cumsum(shares, 3) - 0.5 * shares
        waves = (torch.cos(middle * self.waves) * shares).flatten(1, 2)
        coefficients = torch.matmul(waves, signals.transpose(1, 2))
        means = coefficients[:, WAVES + 1]
        # Turns to the left and to the right, at both scales and in each plane.
        turns = slice(PLANES, 3 * PLANES)
        left = means[:, SIGNED:][:, turns] * sizes[:, 2:3]
        right = left - means[:, turns] * sizes[:, 2:3]
        one_way = torch.cat([torch.minimum(left, right), torch.maximum(left, right)], 1)
        return torch.cat(
            [
                coefficients.flatten(1),
                coefficients[:, :, :SIGNED].abs().flatten(1),
                # Padding is 0, so it must count where there is none as well.
                signals[:, : 3 * PLANES].amax(2).clamp(min=0.0),
                signals[:, : 3 * PLANES].amin(2).clamp(max=0.0),
                one_way,
                torch.log(torch.cat([one_way.clamp(min=0.0) + 0.02, sizes], 1)),
                torch.log(coefficients[:, 0, SIGNED : SIGNED + PLANES] + 1e-4),
            ],
            1,
        )
