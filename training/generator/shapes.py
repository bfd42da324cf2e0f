"""What people are asked to perform: the four primitives, as a direction of travel over progress.

Rows are performances. A shape lies in the horizontal plane, or in a vertical one. Directions are in
rad, counter-clockwise about z up; in a vertical plane they grow from ahead to up.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.generator.people import People, Style

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DURATION_S = {"line": (2.3, 0.38), "arc": (2.7, 0.36), "sine": (4.8, 0.25), "helix": (3.1, 0.36)}
"""Median and log deviation (chosen so that lengths are as in the thesis: at least 2 s was the aim,
less than 1 s dropped, a sine has 229 samples on average and 375 at most, at 45 Hz)."""
LONGEST_S = {"line": 8.0, "arc": 8.0, "sine": 7.9, "helix": 8.0}
SHORTEST_S = 1.1
VERTICAL_SHARE = {"line": 0.2, "arc": 0.06, "sine": 0.06, "helix": 0.0}
STRAIGHT_SHARE = 0.25
"""Curved primitives that begin with a straight piece."""
PILOT_QUICKER = 0.7
"""A vehicle's lag and a pilot's corrections come on top of the time a path should take."""
YAW_SWEEP_SHARE = 0.6
"""Who turns the vehicle by yaw flies smaller sweeps: full stick is 1 rad/s on the tum plant."""
COMPASS_SHARE = 0.5
"""Those who set out in one of the pad's eight directions (figure 3.2 of the thesis shows six)."""
YAW_SINE_SHARE = 0.75
"""And gentler sines of fewer periods."""
LEAST_SWEEP_RAD = math.radians(70.0)
TAIL_FIRST_SHARE = 0.1
MOST_TURN_RADPS = 0.85
"""The fastest turn that they plan."""


@dataclass(frozen=True)
class Shapes:
    """What n people are asked for; each field (n,).

    Attributes:
        duration_s: how long it should take.
        start_rad: the first direction, relative to the vehicle's heading.
        vertical: whether it lies in a vertical plane, whose horizontal direction is `plane_rad`.
        plane_rad: that direction.
        sweep_rad: turn of an arc from beginning to end, 0 otherwise.
        cycles: periods of a sine.
        slope: a sine's steepest slope against its axis, 0 otherwise.
        phase_rad: where in its period a sine begins.
        along_axis: whether a sine's axis is held while the other swings, instead of the speed.
        straight: share of the performance before a curve begins.
        climb: vertical share of a helix, of its horizontal speed.
        bend_rad: a bend of the whole that was not asked for.
        uneven: an arc that tightens (> 0), a swing that grows.
    """

    duration_s: Array
    start_rad: Array
    vertical: Mask
    plane_rad: Array
    sweep_rad: Array
    cycles: Array
    slope: Array
    phase_rad: Array
    along_axis: Mask
    straight: Array
    climb: Array
    bend_rad: Array
    uneven: Array

    def direction(self, progress: Array) -> Array:
        """Direction of travel (n, k) in the shape's plane at progress (n, k), 0 to 1 and beyond."""
        done = self._curved(progress)
        warped = done + self.uneven[:, None] * done * (done - 1.0) * 0.8
        swing = 1.0 + 1.2 * self.uneven[:, None] * (done - 0.5)
        wave = np.arctan(self.slope[:, None] * swing * np.cos(self._phase(done)))
        # A shape that begins straight goes on in that direction.
        wave -= np.where(
            self.straight > 0.0, np.arctan(self.slope * swing[:, 0] * np.cos(self.phase_rad)), 0.0
        )[:, None]
        bend = self.bend_rad[:, None] * (progress - 0.5)
        turned = self.sweep_rad[:, None] * warped + wave + bend
        return np.asarray(self.start_rad[:, None] + turned)

    def speed(self, progress: Array) -> Array:
        """Speed (n, k) along the path, of the largest."""
        swing = (self.slope[:, None] * np.cos(self._phase(self._curved(progress)))) ** 2
        return np.where(
            self.along_axis[:, None], np.sqrt((1.0 + swing) / (1.0 + self.slope[:, None] ** 2)), 1.0
        )

    def climbing(self, progress: Array) -> Array:
        """Vertical share (n, k or 1) of the horizontal speed at progress (n, k)."""
        return self.climb[:, None]

    def _curved(self, progress: Array) -> Array:
        straight = self.straight[:, None]
        return np.maximum((progress - straight) / (1.0 - straight), 0.0)

    def _phase(self, done: Array) -> Array:
        return 2.0 * math.pi * self.cycles[:, None] * done + self.phase_rad[:, None]


def ask(
    label: str,
    people: People,
    style: Style,
    rng: np.random.Generator,
    scatter: float = 1.0,
    compass_share: float = COMPASS_SHARE,
) -> Shapes:
    """What these people are asked to perform, and how far from it they will be.

    Args:
        label: one of the four primitives.
        people: who.
        style: how they make shapes.
        rng: source of it all.
        scatter: how widely shapes differ from the textbook's; 0 is always the same.
        compass_share: share of those who set out in one of eight directions.
    """
    n = len(people)
    sense = rng.choice((-1.0, 1.0), n)
    median_s, deviation = DURATION_S[label]
    if style is Style.PILOT:
        median_s *= PILOT_QUICKER
    duration_s = median_s * np.exp(deviation * rng.standard_normal(n))
    compass = np.round(rng.uniform(-4.0, 4.0, n)) * (math.pi / 4.0)
    anywhere = rng.uniform(-math.pi, math.pi, n)
    heading_rad = np.where(rng.random(n) < compass_share, compass, anywhere)
    # Who turns the vehicle mostly flies it nose or tail first.
    nose = np.where(rng.random(n) < TAIL_FIRST_SHARE, math.pi, 0.0)
    heading_rad = np.where(people.yaw > 0.5, nose, heading_rad)
    heading_rad = heading_rad + people.heading_rad * scatter * rng.standard_normal(n)
    zeros, no = np.zeros(n), np.zeros(n, dtype=bool)
    vertical = rng.random(n) < VERTICAL_SHARE[label]
    sweep_rad, slope, cycles, phase_rad, climb = zeros, zeros, np.ones(n), zeros, zeros
    straight, along_axis = zeros, no
    start_rad = heading_rad
    if label != "line":
        some = rng.random(n) < STRAIGHT_SHARE
        straight = np.where(some, rng.uniform(0.05, 0.25, n), 0.0)
    if label == "line":
        # Up, down, or slanting.
        elevation = rng.choice((-1.0, 1.0), n) * np.where(
            rng.random(n) < 0.4, math.pi / 2.0, rng.uniform(0.2, 1.2, n)
        )
        start_rad = np.where(vertical, elevation, start_rad)
    elif label == "sine":
        # The window of 200 samples is to hold an inflection (thesis 4.1): periods of 6 s at most.
        usual_s = 3.3 if style is Style.HAND else 3.6
        period_s = usual_s * np.exp(0.3 * scatter * rng.standard_normal(n))
        period_s = np.clip(period_s, 1.4 if style is Style.HAND else 2.4, 6.0)
        cycles = np.clip(duration_s / period_s, 0.85, 3.0)
        slope = np.exp(rng.normal(math.log(1.0), 0.35, n))
        turning = people.yaw > 0.5
        cycles = np.where(turning, np.maximum(YAW_SINE_SHARE * cycles, 0.85), cycles)
        slope = np.where(turning, YAW_SINE_SHARE * slope, slope)
        duration_s = cycles * period_s
        offset = np.where(rng.random(n) < 0.2, rng.uniform(-1.5, 1.5, n), rng.normal(0.0, 0.35, n))
        phase_rad = np.where(sense > 0.0, 0.0, math.pi) + scatter * offset
        along_axis = rng.random(n) < 0.5
        start_rad = np.where(vertical, 0.0, heading_rad)
    else:
        turns = np.where(
            rng.random(n) < 0.6, rng.uniform(70.0, 200.0, n), rng.uniform(180.0, 420.0, n)
        )
        sweep_rad = sense * np.radians(150.0 + min(scatter, 1.0) * (turns - 150.0))
        sweep_rad = np.where(people.yaw > 0.5, YAW_SWEEP_SHARE * sweep_rad, sweep_rad)
        sweep_rad = np.sign(sweep_rad) * np.maximum(np.abs(sweep_rad), LEAST_SWEEP_RAD)
        # Larger sweeps take longer.
        duration_s = duration_s * (np.abs(sweep_rad) / 2.6) ** 0.25
        if label == "helix":
            climb = rng.choice((-1.0, 1.0), n) * np.exp(rng.normal(math.log(0.7), 0.45, n))
        start_rad = np.where(vertical, anywhere, heading_rad)
    shapes = Shapes(
        duration_s=np.clip(duration_s, SHORTEST_S, LONGEST_S[label]),
        start_rad=start_rad,
        vertical=vertical,
        plane_rad=heading_rad,
        sweep_rad=sweep_rad,
        cycles=cycles,
        slope=slope,
        phase_rad=phase_rad,
        along_axis=along_axis,
        straight=straight,
        climb=climb,
        bend_rad=scatter * people.bend_rad * rng.standard_normal(n),
        uneven=np.clip(scatter * people.uneven * rng.standard_normal(n), -0.8, 0.8),
    )
    return _feasible(shapes, people)


def _feasible(shapes: Shapes, people: People) -> Shapes:
    """Who steers by yaw takes as long as the sharpest turn of the shape needs."""
    progress = np.linspace(0.0, 1.0, 60)[None].repeat(len(people), axis=0)
    per_progress = np.abs(np.diff(shapes.direction(progress), axis=1)).max(axis=1) * 59.0
    needed_s = np.where(people.yaw > 0.5, per_progress / MOST_TURN_RADPS, 0.0)
    duration_s = np.clip(np.maximum(shapes.duration_s, needed_s), SHORTEST_S, 8.2)
    return Shapes(**(vars(shapes) | {"duration_s": duration_s}))
