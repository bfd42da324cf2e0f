"""A level manoeuvre of lines and arcs that repeats itself, as the sides and corners of a square.

Where one segment ends and the next begins is found for the whole way at once, by dynamic
programming over the misfits of a line or a circle to every stretch, with a penalty a segment. That
is done anew with each intent, so the last segments may change as more of them is seen. What is
suggested is the sequence flown before: each segment must have been seen whole once, and the next
one begun again.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.arc import angles_about, taubin
from services.synthesis.primitives.plane import at_ways, way_of
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    MAX_STEPS,
    STEP_M,
    Example,
    Quality,
    Shape,
    UnfitError,
)

CHORD_M = 0.2
"""The way is cut into chords of this length; change points are found to about one of them."""
BOUND_STD_M = CHORD_M
"""Standard error of a segment's length: each of its ends is off by about a chord."""
MIN_SIGMA_M = 0.005
"""Of the points; what is smoother is not trusted to be better."""
SMOOTH = 2.5
"""A hand errs alike over half a metre: so many chords are one observation."""
MIN_CHORDS = 4
"""Of a segment: 0.8 m."""
MAX_CHORDS = 200
MAX_PERIOD = 4
"""Most different segments of a sequence."""
STRAIGHT_RAD = math.radians(12.0)
"""Segments that turn by less than this are lines."""
SAME_TURN_RAD = math.radians(20.0)
SAME_LENGTH_SHARE = 0.3
SAME_LENGTH_M = 0.6
LAPS_AHEAD = 2
RMS_LIMIT_M = 0.15


@dataclass(frozen=True)
class Segment:
    """A line or an arc.

    Attributes:
        length_m: along the way.
        turn_rad: from its beginning to its end, + counter-clockwise; 0 of a line.
    """

    length_m: float
    turn_rad: float

    def repeats(self, other: "Segment") -> bool:
        """Whether two whole segments are the same to who flies them by hand."""
        allowed = max(SAME_LENGTH_M, SAME_LENGTH_SHARE * other.length_m)
        return (
            abs(self.length_m - other.length_m) <= allowed
            and abs(self.turn_rad - other.turn_rad) <= SAME_TURN_RAD
        )

    def begins(self, other: "Segment") -> bool:
        """Whether this may be the beginning, or the end, of another one."""
        share = min(self.length_m / max(other.length_m, 1e-9), 1.0)
        longest_m = other.length_m + max(SAME_LENGTH_M, SAME_LENGTH_SHARE * other.length_m)
        return (
            self.length_m <= longest_m
            and abs(self.turn_rad - share * other.turn_rad) <= SAME_TURN_RAD
        )


@dataclass(frozen=True)
class Compound(Shape):
    """The segments to come, the present one first; the `estimate` is the length of a round."""

    name: ClassVar[str] = "compound"
    figures: ClassVar[Mapping[str, str]] = {
        "x": "m",
        "y": "m",
        "z": "m",
        "heading": "rad",
        "segments": "1",
        "flown": "m",
        **{f"length_{i}": "m" for i in range(1, MAX_PERIOD + 1)},
        **{f"turn_{i}": "rad" for i in range(1, MAX_PERIOD + 1)},
    }
    min_points: ClassVar[int] = 24
    steady: ClassVar[bool] = False

    anchor_m: Array
    heading_rad: float
    heading_std_rad: float
    segments: tuple[Segment, ...]
    flown_m: float
    """Of the present segment."""

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """Change points, then the shortest sequence that the segments repeat."""
        xy = _even(points_m[:, :2])
        bounds, off_m = _change_points(xy)
        headings = [_headings(xy[begin : end + 1]) for begin, end in itertools.pairwise(bounds)]
        segments = _segments(bounds, headings)
        period = _period(segments)
        # The present segment is the last one; it is as long as the one a round before.
        coming = tuple(segments[len(segments) - 1 - period : len(segments) - 1])
        heights = points_m[:, 2]
        round_m = sum(each.length_m for each in coming)
        flown_m = segments[-1].length_m
        return cls(
            quality=Quality(
                rms_m=math.hypot(max(off_m, MIN_SIGMA_M), float(heights.std())),
                extent_m=CHORD_M * bounds[-1],
                # The chords bound what is known, however many points there are.
                count=math.ceil(bounds[-1] / SMOOTH),
                estimate=round_m,
                estimate_std=BOUND_STD_M,
                doubt=BOUND_STD_M / max(round_m, 1e-9),
            ),
            anchor_m=np.array([*start_m[:2], float(heights.mean())]),
            heading_rad=math.remainder(headings[-1][1], 2.0 * math.pi),
            # The slope of a parabola at its end, as in the fit of a line for the middle: 4 times.
            heading_std_rad=4.0 * off_m * math.sqrt(12.0 / (flown_m / CHORD_M)) / flown_m,
            segments=coming,
            flown_m=flown_m,
        )

    @property
    def params(self) -> dict[str, float]:
        """The place, the heading, what is flown of the present segment, and the sequence."""
        x, y, z = (float(v) for v in self.anchor_m)
        params = {
            "x": x,
            "y": y,
            "z": z,
            "heading": self.heading_rad,
            "segments": float(len(self.segments)),
            "flown": self.flown_m,
        }
        for i, each in enumerate(self.segments, start=1):
            params |= {f"length_{i}": each.length_m, f"turn_{i}": each.turn_rad}
        return params

    @property
    def stds(self) -> dict[str, float]:
        """Of the heading by the regression, of lengths by the chords' length."""
        lengths = {
            f"length_{i}": CHORD_M / math.sqrt(6.0) for i in range(1, 1 + len(self.segments))
        }
        return {"heading": self.heading_std_rad, **lengths}

    @property
    def tolerances(self) -> dict[str, float]:
        """The sequence's number of segments: the rest moves on with the vehicle."""
        return {"segments": 0.5}

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """A rounded rectangle's sides and corners in turn; `extent` in rounds of two segments."""
        side = Segment(float(rng.uniform(2.0, 4.0)), 0.0)
        sense = float(rng.choice((-1.0, 1.0)))
        turn = sense * float(rng.uniform(math.radians(60.0), math.radians(120.0)))
        corner = Segment(float(rng.uniform(1.0, 1.6)) * abs(turn), turn)
        heading = float(rng.uniform(-math.pi, math.pi))
        whole_m = extent * (side.length_m + corner.length_m)
        way = np.linspace(0.0, whole_m, max(count, 2))
        xy, headings = _flown(np.zeros(2), heading, (side, corner), 0.0, way)
        x, y = (float(v) for v in rng.uniform(-10.0, 10.0, 2))
        z = float(rng.uniform(1.0, 3.0))
        points = np.column_stack([xy + np.array([x, y]), np.full(len(xy), z)])
        into = whole_m % (side.length_m + corner.length_m)
        order = (side, corner) if into < side.length_m else (corner, side)
        flown = into if into < side.length_m else into - side.length_m
        return Example(
            points,
            {
                "x": float(points[-1, 0]),
                "y": float(points[-1, 1]),
                "z": z,
                "heading": math.remainder(float(headings[-1]), 2.0 * math.pi),
                "segments": 2.0,
                "flown": flown,
                "length_1": order[0].length_m,
                "turn_1": order[0].turn_rad,
                "length_2": order[1].length_m,
                "turn_2": order[1].turn_rad,
            },
        )

    @property
    def rms_limit_m(self) -> float:
        """The same for all: segments are told apart by directions, not by size."""
        return RMS_LIMIT_M

    def check(self, config: Config) -> None:
        """Refuse corners too tight to fly."""
        for each in self.segments:
            if each.turn_rad and each.length_m / abs(each.turn_rad) < config.min_radius_m:
                radius_m = each.length_m / abs(each.turn_rad)
                raise UnfitError(f"it has a corner of {radius_m:.2f} m radius")

    def ahead(self) -> Array:
        """Two rounds from the vehicle's place on."""
        whole_m = LAPS_AHEAD * sum(each.length_m for each in self.segments)
        steps = min(max(round(whole_m / STEP_M), 2), MAX_STEPS)
        way = np.linspace(0.0, whole_m, steps + 1)
        xy, _ = _flown(self.anchor_m[:2], self.heading_rad, self.segments, self.flown_m, way)
        return np.column_stack([xy, np.full(len(xy), self.anchor_m[2])])


def _even(xy: Array) -> Array:
    """Points (M, 2) `CHORD_M` apart along the way of points (N, 2), oldest first."""
    whole_m = float(way_of(xy)[-1])
    count = math.floor(whole_m / CHORD_M)
    if count < 3 * MIN_CHORDS:
        raise UnfitError("the way is too short")
    # The newest chords end at the vehicle; the oldest may be cut off.
    return at_ways(xy, whole_m - CHORD_M * np.arange(min(count, MAX_CHORDS), -1, -1.0))


def _change_points(xy: Array) -> tuple[list[int], float]:
    """Bounds of the segments of points (N, 2), 0 and N - 1 among them, and the misfit's rms in m.

    Least squared misfit plus a penalty a parameter of each segment (BIC). Circles are Kasa's: their
    misfits to all stretches follow from running sums of the points' moments.
    """
    count = len(xy)
    x, y = (xy - xy.mean(axis=0)).T
    square = x**2 + y**2
    terms = (x, y, x * x, x * y, y * y, x * square, y * square, square, square**2, np.ones(count))
    sums = np.concatenate([np.zeros((len(terms), 1)), np.cumsum(terms, axis=1)], axis=1)
    noise = np.diff(xy, n=3, axis=0)
    sigma = max(1.4826 * float(np.median(np.abs(noise))) / math.sqrt(20.0), MIN_SIGMA_M)
    penalty = SMOOTH * sigma**2 * math.log(count)
    best = np.full(count, np.inf)
    best[0] = 0.0
    came_from = np.zeros(count, dtype=int)
    for end in range(MIN_CHORDS, count):
        begins = np.arange(0, end - MIN_CHORDS + 1)
        # Neighbours share the point between them.
        line, circle = _misfits(sums[:, end + 1, None] - sums[:, begins])
        costs = best[begins] + np.minimum(line + 3.0 * penalty, circle + 4.0 * penalty)
        came_from[end] = int(np.argmin(costs))
        best[end] = costs[came_from[end]]
    bounds = [count - 1]
    while bounds[-1] > 0:
        bounds.append(int(came_from[bounds[-1]]))
    bounds.reverse()
    squares = 0.0
    for begin, end in itertools.pairwise(bounds):
        line, circle = _misfits((sums[:, end + 1] - sums[:, begin])[:, None])
        squares += float(min(line[0], circle[0]))
    return bounds, math.sqrt(squares / count)


def _misfits(moments: Array) -> tuple[Array, Array]:
    """Squared misfits (K,) of the best lines and circles to stretches with moments (10, K)."""
    x, y, xx, xy, yy, xs, ys, s, ss, n = moments
    x, y, s = x / n, y / n, s / n
    xx, xy, yy = xx - n * x * x, xy - n * x * y, yy - n * y * y
    xs, ys, ss = xs - n * x * s, ys - n * y * s, ss - n * s * s
    half = (xx + yy) / 2.0
    line = half - np.sqrt(((xx - yy) / 2.0) ** 2 + xy**2)
    # s = 2 a x + 2 b y + c about the stretch's mean.
    determinant = xx * yy - xy**2
    known = determinant > 1e-9 * half**2
    determinant = np.where(known, determinant, 1.0)
    a = (yy * xs - xy * ys) / determinant
    b = (xx * ys - xy * xs) / determinant
    algebraic = ss - a * xs - b * ys
    square_radius = np.maximum((a / 2.0 - x) ** 2 + (b / 2.0 - y) ** 2 + half * 2.0 / n, 1e-9)
    circle = np.where(known, algebraic / (4.0 * square_radius), np.inf)
    return np.maximum(line, 0.0), np.maximum(circle, 0.0)


def _headings(xy: Array) -> tuple[float, float]:
    """Directions of travel in rad at the beginning and the end of a stretch of points (N, 2)."""
    centred = xy - xy.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    along = centred @ axes[0]
    axis = axes[0] if along[-1] > along[0] else -axes[0]
    middle = math.atan2(axis[1], axis[0])
    try:
        centre, _ = taubin(xy)
    except UnfitError:
        return middle, middle
    turn = float(np.ptp(angles_about(centre, xy)))
    if turn < STRAIGHT_RAD:
        return middle, middle
    angles = angles_about(centre, xy)
    sense = 1.0 if angles[-1] > angles[0] else -1.0
    begin, end = (float(angle) + sense * math.pi / 2.0 for angle in (angles[0], angles[-1]))
    return begin, end


def _segments(bounds: list[int], headings: list[tuple[float, float]]) -> list[Segment]:
    """Lengths from the bounds; a corner between two lines turns by what lies between them."""
    straight = [begin == end for begin, end in headings]
    segments = []
    for i, (begin, end) in enumerate(headings):
        turn = end - begin
        between = 0 < i < len(headings) - 1 and straight[i - 1] and straight[i + 1]
        if not straight[i] and between:
            exact = headings[i + 1][0] - headings[i - 1][1]
            turn += math.remainder(exact - turn, 2.0 * math.pi)
        segments.append(Segment(CHORD_M * (bounds[i + 1] - bounds[i]), turn))
    return segments


def _period(segments: list[Segment]) -> int:
    """How many segments make a round.

    Raises:
        UnfitError: if no sequence was seen whole and begun again.
    """
    for period in range(2, MAX_PERIOD + 1):
        # The first may have begun before the way, the last is being flown: neither is whole.
        if len(segments) < period + 2:
            break
        whole = segments[1:-1]
        ends = segments[0].begins(segments[period]) and segments[-1].begins(segments[-1 - period])
        if ends and all(a.repeats(b) for a, b in zip(whole[period:], whole, strict=False)):
            return period
    raise UnfitError(f"none of its {len(segments)} segments make a round")


def _flown(
    here_m: Array, heading_rad: float, segments: tuple[Segment, ...], flown_m: float, way_m: Array
) -> tuple[Array, Array]:
    """Places (N, 2) and headings (N,) at ways (N,) along segments that follow one another."""
    round_m = sum(each.length_m for each in segments)
    ends = np.cumsum([each.length_m for each in segments])
    turns = np.concatenate([[0.0], np.cumsum([each.turn_rad for each in segments])])

    def heading_at(way: Array) -> Array:
        rounds, into = np.divmod(way, round_m)
        index = np.minimum(np.searchsorted(ends, into, side="right"), len(segments) - 1)
        begins = np.concatenate([[0.0], ends])[index]
        slope = np.array([each.turn_rad / each.length_m for each in segments])[index]
        return np.asarray(rounds * turns[-1] + turns[index] + (into - begins) * slope)

    before = float(heading_at(np.array([flown_m]))[0])
    headings = heading_rad + heading_at(way_m + flown_m) - before
    middles = heading_rad + heading_at((way_m[1:] + way_m[:-1]) / 2.0 + flown_m) - before
    steps = np.diff(way_m)[:, None] * np.column_stack([np.cos(middles), np.sin(middles)])
    return here_m + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]), headings
