"""What an operator means: the four primitives as velocities for hands, as paths for pilots.

Headings are in rad, counter-clockwise about z up; sticks are fractions of full stick.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HAND_DURATIONS_S = {"line": (1.2, 5.0), "arc": (1.5, 6.5), "sine": (2.6, 8.0), "helix": (2.0, 7.5)}
"""The thesis aimed at 2 s at least; its sinusoids last 229 samples, 5 s, on average."""
PATH_STEP_M = 0.05
STEPPED_SHARE = 0.25
"""Share of curved primitives that begin with a straight piece, as people do when they start."""


@dataclass(frozen=True)
class PathPlan:
    """A path for a pilot, from the origin, and how fast it is to be flown.

    Attributes:
        points_m: (N, 2) every `PATH_STEP_M`.
        speed_mps: along the path.
        climb_mps: vertical speed meant throughout.
    """

    points_m: Array
    speed_mps: float
    climb_mps: float


def _straight_start(label: str, rng: np.random.Generator, duration_s: float) -> float:
    """Seconds of straight flight before a curve begins."""
    if label == "line" or rng.random() > STEPPED_SHARE:
        return 0.0
    return float(rng.uniform(0.15, min(1.0, 0.25 * duration_s)))


def hand_plan(label: str, rng: np.random.Generator, step_s: float) -> Array:
    """A primitive as a hand means it: quick gestures and slow wide turns alike.

    Returns:
        (N, 3) forward, left, up every `step_s`, before arm and thumb blur it.
    """
    duration_s = rng.uniform(*HAND_DURATIONS_S[label])
    t = np.arange(0.0, duration_s, step_s)
    start_rad = rng.uniform(-math.pi, math.pi)
    sense = rng.choice((-1.0, 1.0))
    magnitude = rng.uniform(0.3, 1.0)
    up = np.zeros_like(t)
    straight_s = _straight_start(label, rng, duration_s)
    curved_t = np.maximum(t - straight_s, 0.0)
    level = np.full_like(t, magnitude)

    if label == "line":
        heading = np.full_like(t, start_rad)
        kind = rng.random()
        if kind < 0.12:
            level = np.zeros_like(t)
            up = np.full_like(t, sense * magnitude)
        elif kind < 0.3:
            up = np.full_like(t, sense * rng.uniform(0.1, 0.8))
    elif label in ("arc", "helix"):
        # A gesture turns by 50 to 420 degrees whatever its length; a steered turn is slow and wide.
        if rng.random() < 0.65:
            sweep_rad = math.radians(rng.uniform(50.0, 420.0))
            rate = sweep_rad / max(duration_s - straight_s, 1.0)
        else:
            rate = rng.uniform(0.14, 0.6)
        heading = start_rad + sense * rate * curved_t
        if label == "helix":
            up = np.full_like(t, rng.choice((-1.0, 1.0)) * rng.uniform(0.15, 0.9))
    else:
        half_periods = rng.uniform(1.6, 4.5)
        period_s = max(2.0 * (duration_s - straight_s) / half_periods, 0.9)
        phase = rng.uniform(-0.6, 0.6) + (math.pi if sense < 0 else 0.0)
        swing = rng.uniform(0.45, 2.0)
        wave = np.where(
            t < straight_s, 0.0, swing * np.cos(2.0 * math.pi * curved_t / period_s + phase)
        )
        heading = start_rad + np.arctan(wave)
        if rng.random() >= 0.5:
            # One axis is held, and the other swings on its own.
            level = magnitude * np.sqrt(1.0 + wave**2) / math.sqrt(1.0 + swing**2)
        if rng.random() < 0.1:
            up = np.full_like(t, rng.uniform(-0.15, 0.15))
    return np.stack([level * np.cos(heading), level * np.sin(heading), up], axis=1)


def path_plan(label: str, rng: np.random.Generator) -> PathPlan:
    """A primitive as a pilot means it: metres in the world at 0.4 to 1 m/s."""
    speed_mps = rng.uniform(0.4, 1.0)
    climb_mps = 0.0
    sense = rng.choice((-1.0, 1.0))
    length_m = speed_mps * rng.uniform(2.5, 9.0)
    s = np.arange(0.0, length_m + 3.0, PATH_STEP_M)
    straight_m = speed_mps * _straight_start(label, rng, 4.0)
    bend = np.maximum(s - straight_m, 0.0)
    if label == "line":
        points = np.stack([s, np.zeros_like(s)], axis=1)
        if rng.random() < 0.2:
            climb_mps = rng.uniform(-0.3, 0.3)
        heading_error_rad = rng.normal(0.0, 0.12)
        return PathPlan(_turned(points, heading_error_rad), speed_mps, climb_mps)
    if label in ("arc", "helix"):
        radius_m = math.exp(rng.uniform(math.log(1.2), math.log(6.5)))
        angle = bend / radius_m
        x = radius_m * np.sin(angle) + np.minimum(s, straight_m)
        points = np.stack([x, sense * radius_m * (1.0 - np.cos(angle))], axis=1)
        if label == "helix":
            climb_mps = rng.choice((-1.0, 1.0)) * rng.uniform(0.07, 0.45)
        return PathPlan(points, speed_mps, climb_mps)
    # The thesis asks that the window hold an inflection, so a period is rarely over 8 s long.
    wavelength_m = min(rng.uniform(2.5, 8.0), 9.0 * speed_mps)
    amplitude_m = wavelength_m * rng.uniform(0.09, 0.3)
    phase = rng.uniform(-0.6, 0.6)
    x = np.maximum(s - straight_m, 0.0)
    k = 2.0 * math.pi / wavelength_m
    y = sense * amplitude_m * (np.sin(k * x + phase) - math.sin(phase))
    points = np.stack([s, y], axis=1)
    first_slope = sense * amplitude_m * k * math.cos(phase) if straight_m == 0.0 else 0.0
    return PathPlan(_turned(points, -math.atan(first_slope)), speed_mps, 0.0)


def _turned(points_m: Array, angle_rad: float) -> Array:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.asarray(points_m @ np.array([[c, s], [-s, c]]))
