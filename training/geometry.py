"""What sticks draw in space: a few channels over time, and features of the whole window.

All of it is computed inside the model's graph from the raw sticks, so that no service can prepare
its input otherwise than training did. Few operations matter more here than few multiplications:
each costs about a third of a microsecond, whatever its size. So each formula is written once for
all planes side by side, and means of products are one product of matrices.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

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
EVEN_RAD = 1e-3
"""Turns that cancel each other out leave no more than this of rounding errors."""
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
    "heading heading", "speed speed", "one one", "one rate", "time rate", "time heading",
)  # fmt: skip
"""Products of signals whose mean over the window is used."""
SUMS = ("end u", "end w", "net", "turned", "way")
"""Sums over the window, without sign."""
REACH = {
    "left": {"heading": 1.0},
    "right": {"heading": -1.0},
    "fastest": {"speed": 1.0},
    "slowest": {"one": 2.0, "speed": -1.0},
}
"""Sums of signals whose largest value is used; never below 0, which is what padding is."""
CIRCLE = {
    "determinant": {"u u * w w": 2.0, "u w * u w": -2.0},
    "x": {"w w * u q": 1.0, "u w * w q": -1.0},
    "y": {"u u * w q": 1.0, "u w * u q": -1.0},
}
"""The normal equations' solution: x and y of the centre times the determinant."""
RADIUS_SQUARED = {"x * x": 1.0, "y * y": 1.0, "u u": 1.0, "w w": 1.0}
MEASURES = {
    "off": {"q q": 1.0, "x * u q": -2.0, "y * w q": -2.0},
    "swept": {"u b": 1.0, "w a": -1.0, "x * one b": -1.0, "y * one a": 1.0},
    "net": {"net": 1.0},
    "off's": RADIUS_SQUARED,
    "swept's": RADIUS_SQUARED,
    "net's": {"turned": 1.0, "one one": 0.02},
    "radius squared": RADIUS_SQUARED,
    "turned right": {"turned": 1.0, "net": -1.0},
    "turned left": {"turned": 1.0, "net": 1.0},
    "spread": {"u u": 1.0, "w w": 1.0},
    "heading's": {"heading heading": 1.0},
    "speed's": {"speed speed": 1.0},
    "rate": {"one rate": 1.0 / STEP_S},
    "rate's trend": {"time rate": 1.0 / STEP_S},
    "heading's trend": {"time heading": 1.0},
    "turned": {"turned": 1.0},
    "whole net": {"net": 1.0},
}
"""Of what a motion's features in a plane are made: sums of means, sums and products of two. The
first three are shares of the next three."""
SPREAD_FLOOR = 1e-3
"""Added to the squares below: a fortieth of full stick is no spread, and no net motion. Rounding
errors are far less, so no sum of sticks within full ones is below 0."""
WHOLE_SIGNALS = ("one", "x", "y", "z", "climb", "speed")
WHOLE_MEANS = ("one one", "one x", "one y", "one z", "one climb", "one speed", "z z", "speed speed")
SPREADS = {
    "straight": {
        "one x * one x": 1.0,
        "one y * one y": 1.0,
        "one z * one z": 1.0,
        "one one": SPREAD_FLOOR,
    },
    "climb's": {"z z": 1.0, "one z * one z": -1.0, "one one": SPREAD_FLOOR},
    "speed's": {"speed speed": 1.0, "one speed * one speed": -1.0, "one one": SPREAD_FLOOR},
}
PACE = {"one speed": 1.0, "one one": 0.02}
RATIOS = (
    ({"one climb": 1.0}, PACE),
    ({"one z": 1.0}, PACE),
    ({"straight": 1.0}, PACE),
    ({"climb's": 1.0}, PACE),
    ({"speed's": 1.0}, PACE),
    ({"one z": 1.0}, {"one climb": 1.0, "one one": 0.1}),
    ({"one z": 1.0}, {"climb's": 1.0, "one one": 0.1}),
)
"""Features of the whole window, as what is divided and by what: sums of means without sign, and of
roots of `SPREADS`."""


def _places(products: Sequence[str], names: Sequence[str]) -> Tensor:
    """Where products "a b" of named rows stand in the flattened matrix of all products."""
    pairs = [product.split(" ") for product in products]
    return torch.tensor([names.index(a) * len(names) + names.index(b) for a, b in pairs])


def _terms(sums: Mapping[str, Mapping[str, float]]) -> list[str]:
    """The terms of sums, each once."""
    return list(dict.fromkeys(term for terms in sums.values() for term in terms))


def _factors(products: Sequence[str]) -> tuple[list[str], list[str]]:
    """First and second factors of products "a * b"; of a single "a", the second is 1."""
    pairs = [(*product.split(" * "), "one one") for product in products]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def _matrix(sums: Iterable[Mapping[str, float]], terms: Sequence[str]) -> Tensor:
    """The matrix (terms, sums) that a row of terms is multiplied by."""
    return torch.tensor([[each.get(term, 0.0) for term in terms] for each in sums]).T


def _norm(v: Tensor, dim: int) -> Tensor:
    """Euclidean length along a dimension that stays; torch's own is far slower across rows."""
    return torch.sqrt((v * v).sum(dim, keepdim=True))


class Geometry(nn.Module):
    """Sticks as geometry; its features stay when a motion is turned about z or mirrored."""

    left: Tensor
    uneven: Tensor
    diagonal: Tensor
    planes: Tensor
    across: Tensor
    pairs: Tensor
    frame: Tensor
    lag: Tensor
    reach: Tensor
    products: Tensor
    ridge: Tensor
    solve: Tensor
    around: Tensor
    measure: Tensor
    floors: Tensor
    wholes: Tensor
    spread: Tensor
    ratio: Tensor

    CHANNELS = 8
    STICKS = (3, 4, 2, 5)
    """Which of the channels are the sticks themselves: vx, vy, vz, wz."""
    SUMMARY = 18 * PLANES + 10

    def __init__(self) -> None:
        super().__init__()
        # A quarter turn to the left; of the first two components, without the third.
        left = torch.tensor([[0.0, -1.0], [1.0, 0.0]])
        decay = torch.exp(-STEP_S / LAG_S * torch.arange(LAG_TAPS - 1.0, -1.0, -1.0))
        diagonal = torch.tensor([1.0, 0.0, 0.0, 1.0])
        # Two of: x, y, along the main axis, up, x and y as flown; and 1 and time.
        planes = torch.eye(8)
        planes[3, 3] = UP_PER_AHEAD
        planes = planes[[0, 1, 6, 7, 2, 3, 6, 7, 4, 5, 6, 7]]
        # The matrix (3, 5) that a plane's steps are multiplied by, of what it is made of: the
        # chord, the chord mirrored, the side.
        frame = torch.zeros(5, 3, 5)
        for made_of, row, column, sign in (
            (0, 0, 0, 1.0),
            (1, 0, 1, 1.0),
            (3, 1, 0, -1.0),
            (2, 1, 1, 1.0),
            (4, 2, 2, 1.0),
        ):
            frame[made_of, row, column] = sign
        circle = _terms(CIRCLE)
        means = [*MEANS, *(mean for factor in _factors(circle) for mean in factor)]
        around = _terms(MEASURES)
        known = ["x", "y", *MEANS, *SUMS]
        tops, bottoms = zip(*RATIOS, strict=True)
        squares = [f"{mean} * {mean}" for mean in WHOLE_MEANS]
        for name, constant in {
            # Moments xx, xy, yx, yy less half of xx + yy on the diagonal.
            "uneven": torch.eye(4) - 0.5 * torch.outer(diagonal, diagonal),
            # The length of what is left is its value times the root of 2.
            "diagonal": math.sqrt(0.5) * diagonal,
            "left": left,
            # x, y, speed and a quarter turn to the right, of what is to be multiplied by the step
            # before: its x, y, speed, x, y.
            "across": F.pad(torch.eye(3), (0, 2, 0, 2)) - F.pad(left, (3, 0, 3, 0)),
            # Sine and cosine of the turn from those products, both by the product of the speeds,
            # and that product in halves of STILL squared.
            "pairs": torch.tensor(
                [
                    [0.0, 0.0, 0.0, 1.0, 1.0],
                    [1.0, 1.0, 1.0, 0.0, 0.0],
                    [0.0, 0.0, 2.0 / (STILL * STILL), 0.0, 0.0],
                ]
            ),
            "lag": decay.expand(2, 1, -1) * (1.0 - math.exp(-STEP_S / LAG_S)),
            "planes": planes.view(PLANES, 4, 8),
            "frame": frame.flatten(1),
            "reach": _matrix(REACH.values(), SIGNALS).T,
            "products": _places(means, SIGNALS),
            "ridge": RIDGE * torch.tensor([float(mean in ("u u", "w w")) for mean in means]),
            "solve": _matrix(CIRCLE.values(), circle),
            "around": torch.tensor([[known.index(a) for a in f] for f in _factors(around)]),
            "measure": _matrix(MEASURES.values(), around),
            "floors": torch.tensor(list(FLOORS.values())),
            "wholes": _places(WHOLE_MEANS, WHOLE_SIGNALS),
            "spread": _matrix(SPREADS.values(), [*WHOLE_MEANS, *squares]),
            "ratio": _matrix([PACE, *tops, *bottoms], [*WHOLE_MEANS, *SPREADS]),
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
        flown = F.conv1d(F.pad(flat, (LAG_TAPS - 1, 0)), self.lag, groups=2) * mask
        count = mask.sum(2, keepdim=True)
        share = mask / count
        time = torch.cumsum(share, 2) * mask
        planes = torch.cat([flat, self._ahead(flat), vz, flown, mask, time], 1)
        planes = torch.matmul(self.planes, planes.unsqueeze(1))
        shapes, rate = self._shapes(planes, share.unsqueeze(1), count)
        channels = torch.cat([motion, rate, mask * clock_s[:, :, ::STRIDE]], 1)
        return channels, mask, torch.cat([shapes, self._whole(flat, vz, mask)], 1)

    def _motion(self, x: Tensor, clock_s: Tensor, real: Tensor, full_yaw_radps: Tensor) -> Tensor:
        """Smoothed motion (B, 6, T / STRIDE), 0 where padded.

        Returns:
            vx vy vz in the frame of the first heading, which does not turn with the vehicle; vx and
            vy as the pad sends them, and the yaw rate, rad/s.
        """
        flat, vz, wz = torch.split(x, [2, 1, 1], 1)
        turning = wz * full_yaw_radps
        # A stick is held until the next one, so a step turns by the stick at its beginning.
        steps_s = clock_s - F.pad(clock_s, (1, -1))
        yaw = torch.cumsum(F.pad(turning, (1, -1)) * steps_s, 2)
        sideways = torch.matmul(self.left, flat)
        straight = torch.cos(yaw) * flat + torch.sin(yaw) * sideways
        stacked = torch.cat([straight, vz, flat, turning, real], 1)
        means = F.avg_pool1d(stacked, SMOOTH_TAPS, STRIDE, SMOOTH_TAPS // 2)
        motion, share = torch.split(means, [6, 1], 1)
        return motion * (real[:, :, ::STRIDE] / share.clamp(min=1.0 / SMOOTH_TAPS))

    def _ahead(self, flat: Tensor) -> Tensor:
        """The part (B, 1, T) of a horizontal motion that is along its main axis."""
        moments = torch.matmul(flat, flat.transpose(1, 2)).view(-1, 1, 4)
        # Half of what is left of the moments without their mean; its own value is `stretch`, and
        # with that on the diagonal each row is along the main axis. The longer one is exact.
        uneven = torch.matmul(moments, self.uneven)
        stretch = torch.linalg.vector_norm(uneven, dim=2, keepdim=True)
        first, second = torch.split(uneven + self.diagonal * (stretch + 1e-6), 2, 2)
        axis = torch.where(uneven[:, :, :1] > 0.0, first, second)
        return torch.matmul(axis / torch.linalg.vector_norm(axis, dim=2, keepdim=True), flat)

    def _shapes(self, planes: Tensor, share: Tensor, count: Tensor) -> tuple[Tensor, Tensor]:
        """Features of motions in planes.

        Args:
            planes: (B, PLANES, 4, T), two velocities, mask, time.
            share: (B, 1, 1, T), of each step in the window.
            count: (B, 1, 1), of steps.

        Returns:
            Features (B, n); rates of turn (B, 1, T) in the first plane, rad a step.
        """
        v, mask, time = torch.split(planes, [2, 1, 1], 2)
        speed = _norm(v, 2)
        # Turns from step to step, by the tangent of half the angle: no quadrants, and going
        # straight back turns to no side. Those of a resting stick count for nothing: they are
        # divided by infinity.
        now = torch.cat([v, speed, v], 2)
        pairs = F.pad(now, (1, -1)) * torch.matmul(self.across, now)
        cross, agree, energy = torch.split(torch.matmul(self.pairs, pairs), 1, 2)
        turn = torch.atan(cross / (agree + BACK)) / (0.5 + torch.reciprocal(energy))

        # Along the chord, mirrored so that the whole turns to the left; places as shares of the
        # way. Along the chord what is nearly straight has small products without cancellation.
        steps = torch.cat([v, turn, turn.abs(), speed], 2)
        sums = steps.sum(3)
        end, net, _, way = torch.split(sums, [2, 1, 1, 1], 2)
        side = torch.sign(net + EVEN_RAD)
        length = torch.linalg.vector_norm(end, dim=2, keepdim=True)
        chord = end / ((length + 1e-3) * (way + SHORT_WAY))
        frame = torch.matmul(torch.cat([chord, chord * side, side], 2), self.frame)
        moves = torch.matmul(frame.view(-1, PLANES, 3, 5), steps)
        sides = moves[:, :, :2]
        weights = share.transpose(2, 3)
        # Sums over another than the last dimension are quicker.
        paths = torch.cumsum(moves.transpose(2, 3), 2).transpose(2, 3)
        paths = (paths - torch.matmul(paths, weights)) * mask
        places, heading = torch.split(paths, [2, 1], 2)
        distance = (places * places).sum(2, keepdim=True)
        distance = (distance - torch.matmul(distance, weights)) * mask
        rate = F.avg_pool2d(turn, (1, RATE_TAPS), 1, (0, RATE_TAPS // 2))
        signals = torch.cat([mask, time, places, heading, distance, sides, speed, rate], 2)
        moments = torch.matmul(signals, signals.transpose(2, 3))
        moments = moments.view(-1, PLANES, len(SIGNALS) ** 2)
        means = moments[:, :, self.products] / count + self.ridge
        terms = [len(MEANS), len(self.solve), len(self.solve)]
        means, first, second = torch.split(means, terms, 2)

        # The circle of least algebraic distance (Kasa 1976): how far off it, how far around it.
        solved = torch.matmul(first * second, self.solve)
        determinant, centre = torch.split(solved, [1, 2], 2)
        known = torch.cat([centre / determinant, means, sums.abs()], 2)
        around = known[:, :, self.around[0]] * known[:, :, self.around[1]]
        tops, bottoms, sizes, rates, others = torch.split(
            torch.matmul(around, self.measure), [3, 3, 6, 2, 3], 2
        )
        off, swept, net = torch.split(tops / bottoms, 1, 2)
        sizes = torch.cat([off, sizes], 2)
        # Padding is 0: never the largest.
        reach = torch.matmul(self.reach, signals).amax(3)
        features = torch.cat(
            [
                torch.log(F.relu(sizes) + self.floors),
                rates * side,
                others,
                swept * count,
                net,
                reach,
            ],
            2,
        )
        return features.flatten(1), rate[:, 0]

    def _whole(self, flat: Tensor, vz: Tensor, mask: Tensor) -> Tensor:
        """Features (B, n) that belong to no plane: time, speed, climb."""
        count = mask.sum(2)
        speed = _norm(torch.cat([flat, vz], 1), 1)
        signals = torch.cat([mask, flat, vz, vz.abs(), speed], 1)
        moments = torch.matmul(signals, signals.transpose(1, 2)).flatten(1)
        means = moments[:, self.wholes] / count
        spreads = torch.matmul(torch.cat([means, means * means], 1), self.spread)
        known = torch.cat([means.abs(), torch.sqrt(spreads)], 1)
        ratios = [1, len(RATIOS), len(RATIOS)]
        pace, tops, bottoms = torch.split(torch.matmul(known, self.ratio), ratios, 1)
        duration_s = count * STEP_S
        return torch.cat([duration_s, torch.log(duration_s), pace, tops / bottoms], 1)
