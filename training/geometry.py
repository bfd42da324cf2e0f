"""What sticks draw in space: a few channels over time, and features of the whole window.

All of it is computed inside the model's graph from the raw sticks, so that no service can prepare
its input otherwise than training did. Few operations matter more here than few multiplications:
each costs about a third of a microsecond, whatever its size. So each formula is written once for
all planes side by side, and means of products are one product of matrices.
"""

import math
from collections.abc import Mapping, Sequence

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
"""Steps: rates of turn (rad a step, until they are measures) are means over 0.2 s."""
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
"""Added to mean squares of places, in squares of the way: a line's circle has a finite radius."""
FLOORS = {
    "off": 1e-4,
    "radius squared": 1e-5,
    "turned right": 0.02,
    "turned left": 0.02,
    "spread": 1e-5,
    "heading's": 1e-4,
    "speed's": 3e-3,
}
"""Of the measures whose logarithm is taken, added before: what is much smaller is noise, a rounding
error, or steadier than a hand."""
SIGNALS = ("one", "time", "u", "w", "heading", "q", "a", "b", "speed", "rate")
"""1, time as a share of the window, place from the mean place as a share of the way, heading from
the mean heading, square of the distance from the mean place, from its mean, velocity, speed, rate
of turn in rad a step."""
MEANS = (
    "u u", "u w", "w w", "u q", "w q", "q q", "u b", "w a", "one a", "one b",
    "heading heading", "speed speed", "one rate", "time rate", "time heading",
)  # fmt: skip
"""Products of signals whose mean over the window is used."""
SUMS = ("end u", "end w", "net", "turned", "way")
"""Sums over the window, without sign."""
CIRCLE = {
    "determinant": {"u u * w w": 2.0, "u w * u w": -2.0},
    "x": {"w w * u q": 1.0, "u w * w q": -1.0},
    "y": {"u u * w q": 1.0, "u w * u q": -1.0},
}
"""The normal equations' solution: x and y of the centre times the determinant."""
MEASURES = {
    "off": {"q q": 1.0, "x * u q": -2.0, "y * w q": -2.0},
    "swept": {"u b": 1.0, "w a": -1.0, "x * one b": -1.0, "y * one a": 1.0},
    "radius squared": {"x * x": 1.0, "y * y": 1.0, "u u": 1.0, "w w": 1.0},
    "turned right": {"turned": 1.0, "net": -1.0},
    "turned left": {"turned": 1.0, "net": 1.0},
    "spread": {"u u": 1.0, "w w": 1.0},
    "heading's": {"heading heading": 1.0},
    "speed's": {"speed speed": 1.0},
    "rate": {"one rate": 1.0 / STEP_S},
    "rate's trend": {"time rate": 1.0 / STEP_S},
    "heading's trend": {"time heading": 1.0},
    "turned": {"turned": 1.0},
    "net": {"net": 1.0},
}
"""Of what a motion's features in a plane are made: sums of means, sums and products of two."""
SPREAD_FLOOR = 1e-3
"""Added to the squares below: a fortieth of full stick is no spread, and no net motion."""
WHOLE_SIGNALS = ("one", "x", "y", "z", "climb", "speed")
WHOLE_MEANS = ("one x", "one y", "one z", "one climb", "one speed", "z z", "speed speed")
SPREADS = {
    "straight": {"one x * one x": 1.0, "one y * one y": 1.0, "one z * one z": 1.0},
    "climb's": {"z z": 1.0, "one z * one z": -1.0},
    "speed's": {"speed speed": 1.0, "one speed * one speed": -1.0},
}


def _places(products: Sequence[str], names: Sequence[str]) -> Tensor:
    """Where products "a b" of named rows stand in the flattened matrix of all products."""
    pairs = [product.split(" ") for product in products]
    return torch.tensor([names.index(a) * len(names) + names.index(b) for a, b in pairs])


def _factors(products: Sequence[str], names: Sequence[str]) -> Tensor:
    """The two factors (2, n) of products "a * b" as indices of names."""
    pairs = [product.split(" * ") for product in products]
    return torch.tensor([[names.index(one) for one in pair] for pair in pairs]).T


def _products(sums: Mapping[str, Mapping[str, float]]) -> list[str]:
    """The products of two in sums, each once."""
    return list(dict.fromkeys(term for terms in sums.values() for term in terms if "*" in term))


def _matrix(sums: Mapping[str, Mapping[str, float]], terms: Sequence[str]) -> Tensor:
    """The matrix (terms, sums) that a row of terms is multiplied by."""
    return torch.tensor([[each.get(term, 0.0) for each in sums.values()] for term in terms])


class Geometry(nn.Module):
    """Sticks as geometry; its features stay when a motion is turned about z or mirrored."""

    left: Tensor
    across: Tensor
    lag: Tensor
    products: Tensor
    ridge: Tensor
    circle: Tensor
    solve: Tensor
    around: Tensor
    measure: Tensor
    floors: Tensor
    wholes: Tensor
    spread: Tensor

    CHANNELS = 8
    STICKS = (3, 4, 2, 5)
    """Which of the channels are the sticks themselves: vx, vy, vz, wz."""
    SUMMARY = 18 * PLANES + 10

    def __init__(self) -> None:
        super().__init__()
        # A quarter turn to the left; of the first two components, without the third.
        left = torch.tensor([[0.0, -1.0], [1.0, 0.0]])
        decay = torch.exp(-STEP_S / LAG_S * torch.arange(LAG_TAPS - 1.0, -1.0, -1.0))
        around = _products(MEASURES)
        known = ["x", "y", *MEANS, *SUMS]
        squares = [f"{mean} * {mean}" for mean in WHOLE_MEANS]
        for name, constant in {
            "left": left,
            "across": F.pad(left, (0, 1, 0, 1)),
            "lag": torch.eye(2)[:, :, None] * decay * (1.0 - math.exp(-STEP_S / LAG_S)),
            "products": _places(MEANS, SIGNALS),
            "ridge": RIDGE * torch.tensor([float(mean in ("u u", "w w")) for mean in MEANS]),
            "circle": _factors(_products(CIRCLE), MEANS),
            "solve": _matrix(CIRCLE, _products(CIRCLE)),
            "around": _factors(around, known),
            "measure": _matrix(MEASURES, [*known, *around]),
            "floors": torch.tensor(list(FLOORS.values())),
            "wholes": _places(WHOLE_MEANS, WHOLE_SIGNALS),
            "spread": _matrix(SPREADS, [*WHOLE_MEANS, *squares]),
        }.items():
            self.register_buffer(name, constant, persistent=False)

    def forward(
        self, sticks: Tensor, times_s: Tensor, lengths: Tensor, full_yaw_radps: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Geometry of windows; inputs as in services/classifier/model.py.

        Returns:
            Channels (B, CHANNELS, T / STRIDE), 0 where padded; mask (B, 1, T / STRIDE), 1 where
            not; summary (B, SUMMARY).
        """
        real = (torch.arange(sticks.shape[1]) < lengths.view(-1, 1, 1)).to(sticks.dtype)
        x = sticks.transpose(1, 2) * real
        clock_s = times_s.unsqueeze(1)
        motion = self._motion(x, clock_s, real, full_yaw_radps.view(-1, 1, 1))
        mask = real[:, :, ::STRIDE]
        flat, vz, _ = torch.split(motion, [2, 1, 3], 1)
        upright = torch.cat([self._ahead(flat), UP_PER_AHEAD * vz], 1)
        flown = F.conv1d(F.pad(flat, (LAG_TAPS - 1, 0)), self.lag) * mask
        planes = torch.stack([flat, upright, flown], 1)
        shapes, rate = self._shapes(planes, mask.unsqueeze(1))
        channels = torch.cat([motion, rate, mask * clock_s[:, :, ::STRIDE]], 1)
        return channels, mask, torch.cat([shapes, self._whole(motion[:, :3], mask)], 1)

    def _motion(self, x: Tensor, clock_s: Tensor, real: Tensor, full_yaw_radps: Tensor) -> Tensor:
        """Smoothed motion (B, 6, T / STRIDE), 0 where padded.

        Returns:
            vx vy vz in the frame of the first heading, which does not turn with the vehicle; vx and
            vy as the pad sends them, and the yaw rate, rad/s.
        """
        flat, vz, wz = torch.split(x, [2, 1, 1], 1)
        turning = wz * full_yaw_radps
        # A stick is held until the next one, so a step turns by the stick at its beginning.
        held = turning[:, :, :-1] * (clock_s[:, :, 1:] - clock_s[:, :, :-1])
        yaw = torch.cumsum(F.pad(held, (1, 0)), 2)
        sideways = torch.matmul(self.left, flat)
        straight = torch.cos(yaw) * flat + torch.sin(yaw) * sideways
        stacked = torch.cat([straight, vz, flat, turning, real], 1)
        means = F.avg_pool1d(stacked, SMOOTH_TAPS, STRIDE, SMOOTH_TAPS // 2)
        motion, share = torch.split(means, [6, 1], 1)
        return motion * (real[:, :, ::STRIDE] / share.clamp(min=1.0 / SMOOTH_TAPS))

    @staticmethod
    def _ahead(flat: Tensor) -> Tensor:
        """The part (B, 1, T) of a horizontal motion that is along its main axis."""
        moments = torch.matmul(flat, flat.transpose(1, 2)).view(-1, 4, 1)
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
            Features (B, n); rates of turn (B, 1, T) in the first plane, rad a step.
        """
        count = mask.sum(3)
        share = mask / count.unsqueeze(3)
        speed = torch.linalg.vector_norm(v, dim=2, keepdim=True)
        # Turns from step to step, by the tangent of half the angle: no quadrants, and going
        # straight back turns to no side. Those of a resting stick count for nothing.
        both = torch.cat([v, speed], 2)
        before, after = both[:, :, :, :-1], both[:, :, :, 1:]
        agree = before * after
        energy = agree[:, :, 2:]
        cross = (torch.matmul(self.across, before) * after).sum(2, keepdim=True)
        half = torch.atan(cross / (agree.sum(2, keepdim=True) + BACK))
        turn = F.pad(half * energy / (0.5 * energy + 0.5 * STILL * STILL), (1, 0))

        # Along the chord, mirrored so that the whole turns to the left; places as shares of the
        # way. Along the chord what is nearly straight has small products without cancellation.
        sums = torch.cat([v, turn, turn.abs(), speed], 2).sum(3, keepdim=True)
        end, net, _, way = torch.split(sums, [2, 1, 1, 1], 2)
        side = torch.sign(net + 1e-9)
        size = 1.0 / (way + SHORT_WAY)
        chord = end / (torch.linalg.vector_norm(end, dim=2, keepdim=True) + 1e-3)
        frame = torch.cat([chord, torch.matmul(self.left, chord)], 3).transpose(2, 3)
        local = torch.matmul(frame, v)
        moves = torch.cat([local, turn], 2) * torch.cat([size, size * side, side], 2)
        sides, turns = torch.split(moves, [2, 1], 2)
        weights = share.transpose(2, 3)
        paths = torch.cumsum(moves, 3)
        paths = (paths - torch.matmul(paths, weights)) * mask
        places, heading = torch.split(paths, [2, 1], 2)
        distance = (places * places).sum(2, keepdim=True)
        distance = (distance - torch.matmul(distance, weights)) * mask
        rate = F.avg_pool2d(turns, (1, RATE_TAPS), 1, (0, RATE_TAPS // 2))
        clock = torch.cat([mask, torch.cumsum(share, 3) * mask], 2)
        clock = torch.cat([clock] * PLANES, 1)
        signals = torch.cat([clock, places, heading, distance, sides, speed, rate], 2)
        moments = torch.matmul(signals, signals.transpose(2, 3))
        moments = moments.view(-1, PLANES, len(SIGNALS) ** 2)
        means = moments[:, :, self.products] / count + self.ridge

        # The circle of least algebraic distance (Kasa 1976): how far off it, how far around it.
        solved = torch.matmul(means[:, :, self.circle[0]] * means[:, :, self.circle[1]], self.solve)
        determinant, centre = torch.split(solved, [1, 2], 2)
        known = torch.cat([centre / determinant, means, sums.squeeze(3).abs()], 2)
        known = torch.cat([known, known[:, :, self.around[0]] * known[:, :, self.around[1]]], 2)
        ratios, radius_squared, sizes, others = torch.split(
            torch.matmul(known, self.measure), [2, 1, 5, 5], 2
        )
        off, swept = torch.split(ratios / radius_squared, 1, 2)
        sizes = torch.cat([off, radius_squared, sizes], 2)
        turned, net = others[:, :, 3:4], others[:, :, 4:]
        # Padding is 0: never the largest.
        reach = torch.cat([heading, -heading, speed, mask + mask - speed], 2)
        features = torch.cat(
            [
                torch.log(F.relu(sizes) + self.floors),
                others,
                swept * count,
                net / (turned + 0.02),
                reach.amax(3),
            ],
            2,
        )
        return features.flatten(1), rate[:, 0] * side[:, 0]

    def _whole(self, v: Tensor, mask: Tensor) -> Tensor:
        """Features (B, n) that belong to no plane: time, speed, climb."""
        count = mask.sum(2)
        speed = torch.linalg.vector_norm(v, dim=1, keepdim=True)
        signals = torch.cat([mask, v, v[:, 2:].abs(), speed], 1)
        moments = torch.matmul(signals, signals.transpose(1, 2)).flatten(1)
        means = moments[:, self.wholes] / count
        spreads = torch.matmul(torch.cat([means, means * means], 1), self.spread)
        spreads = torch.sqrt(F.relu(spreads) + SPREAD_FLOOR)
        _, rise, climb, level, _ = torch.split(means.abs(), [2, 1, 1, 1, 2], 1)
        pace = level + 0.02
        duration_s = count * STEP_S
        shares = torch.cat([climb, rise, spreads], 1) / pace
        steady = rise / (torch.cat([climb, spreads[:, 1:2]], 1) + 0.1)
        return torch.cat([duration_s, torch.log(duration_s), pace, shares, steady], 1)
