"""What sticks draw in space: a few channels over time, and features of the whole window.

All of it is computed inside the model's graph from the raw sticks, so that no service can prepare
its input otherwise than training did. Few operations matter more here than few multiplications:
each costs about a third of a microsecond, whatever its size. So each formula is written once for
all planes side by side, and means of products are one product of matrices.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from services.classifier.window import MODEL_RATE_HZ

STRIDE = 2
"""Steps have half the model's rate: thumbs do nothing above 12 Hz but tremble."""
STEP_S = STRIDE / MODEL_RATE_HZ
SMOOTH_TAPS = 9
"""Samples: 0.18 s, above tremor's period, below the quickest gesture's."""
RATE_TAPS = 5
"""Steps: rates of turn are means over 0.2 s."""
STILL = 0.1
"""Below this deflection a direction is mostly noise."""
BACK = 1e-4
"""Keeps the turn of a stick that is pulled straight back from depending on a rounding error."""
LAG_S, LAG_TAPS = 0.4, 40
"""A vehicle's speed follows its stick with about this time constant (tum plant 0.3 to 0.4 s)."""
UP_PER_AHEAD = 0.5
"""Speed of full stick upwards, of that ahead (tum plant; about as much on the ardrone)."""
PLANES = 3
"""Shapes are measured in the horizontal plane as the sticks draw them, in the vertical one that
most of the motion is in, and in the horizontal one as a vehicle with a lag flies them, since
pilots' sticks lead it."""
SHORT_WAY = 0.25
"""Added to ways, in steps of full stick, so that nothing is divided by 0."""
RIDGE = 1e-6
"""Of a circle's normal equations, in squares of the way: a line's circle has a finite radius."""
FLOORS = (0.02, 0.02, 1e-4, 1e-5, 1e-5, 1e-4, 1e-4)
"""Added before a logarithm is taken: what is much smaller is noise, or a rounding error."""
ONE, TIME, U, W, HEADING, Q, A, B, SPEED, RATE = range(10)
"""Signals: 1, time as a share of the window, place from the mean place as a share of the way,
heading from the mean heading, square of the distance from the mean place, from its mean, velocity,
speed, rate of turn."""
PRODUCTS = (
    (U, U), (U, W), (W, W), (U, Q), (W, Q), (Q, Q), (U, B), (W, A), (ONE, A), (ONE, B),
    (HEADING, HEADING), (SPEED, SPEED), (ONE, RATE), (TIME, RATE), (TIME, HEADING),
)  # fmt: skip
"""Those whose mean over the window is used."""


class Geometry(nn.Module):
    """Sticks as geometry; its features stay when a motion is turned about z or mirrored."""

    lag: Tensor
    left: Tensor
    products: Tensor
    floors: Tensor

    CHANNELS = 8
    STICKS = (0, 1, 5, 2)
    """Which of the channels are the sticks themselves: vx, vy, vz, wz."""
    SUMMARY = 18 * PLANES + 10

    def __init__(self) -> None:
        super().__init__()
        # A quarter turn to the left of the first two components.
        left = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        self.register_buffer("left", left, persistent=False)
        decay = torch.exp(-STEP_S / LAG_S * torch.arange(LAG_TAPS - 1.0, -1.0, -1.0))
        lag = torch.eye(2)[:, :, None] * decay * (1.0 - math.exp(-STEP_S / LAG_S))
        self.register_buffer("lag", lag, persistent=False)
        places = torch.tensor([first * (RATE + 1) + second for first, second in PRODUCTS])
        self.register_buffer("products", places, persistent=False)
        floors = torch.tensor(FLOORS)[:, None]
        self.register_buffer("floors", floors, persistent=False)

    def forward(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Geometry of windows; inputs as in services/classifier/model.py.

        Returns:
            Channels (B, CHANNELS, T / STRIDE), 0 where padded; mask (B, 1, T / STRIDE), 1 where
            not; summary (B, SUMMARY).
        """
        real = (torch.arange(sticks.shape[1]) < lengths.unsqueeze(1)).to(sticks.dtype)
        x = (sticks * real.unsqueeze(2)).transpose(1, 2)
        v, raw, mask = self._velocity(x, times_s, real.unsqueeze(1), full_yaw_radps)
        flat, vz = torch.split(v, [2, 1], 1)
        upright = torch.cat([self._ahead(flat), UP_PER_AHEAD * vz], 1)
        flown = F.conv1d(F.pad(flat, (LAG_TAPS - 1, 0)), self.lag) * mask
        planes = torch.stack([flat, upright, flown], 1)
        shapes, rate = self._shapes(planes, mask.unsqueeze(1))
        time_s = mask * times_s[:, ::STRIDE].unsqueeze(1)
        channels = torch.cat([raw, v, rate, time_s], 1)
        return channels, mask, torch.cat([shapes, self._whole(v, mask)], 1)

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
        sideways = torch.matmul(self.left[:2, :2], flat)
        straight = torch.cos(yaw) * flat + torch.sin(yaw) * sideways
        stacked = torch.cat([straight, vz, flat, turning, real], 1)
        means = F.avg_pool1d(stacked, SMOOTH_TAPS, STRIDE, SMOOTH_TAPS // 2)
        mask = real[:, :, ::STRIDE]
        v, raw, share = torch.split(means, [3, 3, 1], 1)
        scale = mask / share.clamp(min=1.0 / SMOOTH_TAPS)
        return v * scale, raw * scale, mask

    @staticmethod
    def _ahead(flat: Tensor) -> Tensor:
        """The part (B, 1, T) of a horizontal motion that is along its main axis."""
        moments = torch.matmul(flat, flat.transpose(1, 2)).flatten(1).unsqueeze(2)
        xx, xy, yx, yy = torch.split(moments, 1, 1)
        half = 0.5 * (xx - yy)
        square = xy * yx
        large = half.abs() + torch.sqrt(half * half + square + 1e-12)
        is_first = half > 0.0
        axis = torch.cat([torch.where(is_first, large, xy), torch.where(is_first, xy, large)], 1)
        return (axis * flat).sum(1, keepdim=True) / torch.sqrt(large * large + square)

    def _shapes(self, v: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Features of motions in planes.

        Args:
            v: (B, PLANES, 2, T).
            mask: (B, 1, 1, T).

        Returns:
            Features (B, n); rates of turn (B, 1, T) in the first plane, rad/s.
        """
        count = mask.sum(3, keepdim=True)
        speed = torch.sqrt((v * v).sum(2, keepdim=True) + 1e-8) * mask
        # Turns from step to step, by the tangent of half the angle: no quadrants, and going
        # straight back turns to no side. Those of a resting stick count for nothing.
        both = torch.cat([v, speed], 2)
        before, after = both[:, :, :, :-1], both[:, :, :, 1:]
        agree = before * after
        energy = agree[:, :, 2:]
        cross = (torch.matmul(self.left, before) * after).sum(2, keepdim=True)
        half = torch.atan(cross / (agree.sum(2, keepdim=True) + BACK))
        turn = F.pad(half * energy / (0.5 * energy + 0.5 * STILL * STILL), (1, 0))

        # Along the chord, mirrored so that the whole turns to the left; places as shares of the
        # way. Along the chord what is nearly straight has small products without cancellation.
        sums = torch.cat([v, turn, turn.abs(), speed], 2).sum(3, keepdim=True)
        end, net, turned, way = torch.split(sums, [2, 1, 1, 1], 2)
        side = torch.sign(net + 1e-9)
        net = net * side
        share = 1.0 / (way + SHORT_WAY)
        chord = end / torch.sqrt((end * end).sum(2, keepdim=True) + 1e-6)
        frame = torch.cat([chord, torch.matmul(self.left[:2, :2], chord)], 3).transpose(2, 3)
        local = torch.matmul(frame, v)
        moves = torch.cat([local, turn], 2) * torch.cat([share, share * side, side], 2)
        sides, turns = torch.split(moves, [2, 1], 2)
        paths = torch.cumsum(moves, 3)
        paths = (paths - (paths * mask).sum(3, keepdim=True) / count) * mask
        places, heading = torch.split(paths, [2, 1], 2)
        distance = (places * places).sum(2, keepdim=True)
        distance = (distance - distance.sum(3, keepdim=True) / count) * mask
        rate = F.avg_pool2d(turns, (1, RATE_TAPS), 1, (0, RATE_TAPS // 2)) / STEP_S
        clock = torch.cat([mask, torch.cumsum(mask, 3) / count * mask], 2)
        clock = torch.cat([clock] * PLANES, 1)
        signals = torch.cat([clock, places, heading, distance, sides, speed, rate], 2)
        moments = torch.matmul(signals, signals.transpose(2, 3)) / count
        means = moments.flatten(2)[:, :, self.products].unsqueeze(3)
        uu, uw, ww, uq, wq, qq, ub, wa, a, b, headings, speeds, trends = torch.split(
            means, [1] * 12 + [3], 2
        )

        # The circle of least algebraic distance (Kasa 1976): how far off it, how far around it.
        p, r = uu + RIDGE, ww + RIDGE
        determinant = 2.0 * (p * r - uw * uw)
        x, y = (r * uq - uw * wq) / determinant, (p * wq - uw * uq) / determinant
        spread = uu + ww
        radius_squared = x * x + y * y + spread + RIDGE
        off = (qq - 2.0 * (x * uq + y * wq)) / radius_squared
        swept = (ub - wa - x * b + y * a) / radius_squared * count
        sizes = torch.cat(
            [turned - net, turned + net, off, radius_squared, spread, headings, speeds], 2
        )
        # Padding is 0: never the largest, but for a stick that is beyond full speed throughout.
        reach = torch.cat([heading, -heading, speed, mask - speed], 2)
        features = torch.cat(
            [
                torch.log(F.relu(sizes) + self.floors),
                trends,
                swept,
                turned,
                net,
                net / (turned + 0.02),
                reach.amax(3, keepdim=True),
            ],
            2,
        )
        return features.flatten(1), rate[:, 0] * side[:, 0]

    @staticmethod
    def _whole(v: Tensor, mask: Tensor) -> Tensor:
        """Features (B, n) that belong to no plane: time, speed, climb."""
        count = mask.sum(2, keepdim=True)
        squares = v * v
        squared = squares.sum(1, keepdim=True)
        speed = torch.sqrt(squared + 1e-8) * mask
        signals = torch.cat([v, v[:, 2:].abs(), speed, squares[:, 2:], squared], 1)
        means = signals.sum(2, keepdim=True) / count
        net, climb, level, climb_squares, level_squares = torch.split(means, [3, 1, 1, 1, 1], 1)
        rise = net[:, 2:].abs()
        pace = level + 0.02
        spreads = torch.cat([climb_squares - rise * rise, level_squares - level * level], 1)
        spreads = torch.sqrt(F.relu(spreads) + 1e-3)
        straight = torch.sqrt((net * net).sum(1, keepdim=True) + 1e-8)
        duration_s = count * STEP_S
        shares = torch.cat([climb, rise, straight, spreads], 1) / pace
        steady = rise / (torch.cat([climb, spreads[:, :1]], 1) + 0.1)
        return torch.cat([duration_s, torch.log(duration_s), pace, shares, steady], 1).squeeze(2)
