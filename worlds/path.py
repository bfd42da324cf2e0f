"""The ideal path: primitives put end to end, sampled."""

import math
from dataclasses import dataclass

import numpy as np

from worlds.model import Array, Segment, Vector3

PATH_STEP_M = 0.05
"""The ideal path is sampled at least this densely."""


@dataclass(frozen=True)
class Path:
    """Primitives, from where and in which heading the first one begins."""

    start_m: Vector3
    yaw_rad: float
    closed: bool
    segments: tuple[Segment, ...]


def sampled(path: Path, left_m: float, step_m: float, step_rad: float) -> Array:
    """The path (N, 3), moved `left_m` to its left, in steps of at most `step_m` and `step_rad`."""
    place, yaw = np.asarray(path.start_m), path.yaw_rad
    points: list[Array] = []
    for segment in path.segments:
        ahead, headings = _shape(segment, step_m, step_rad)
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = np.asarray([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        middle = place + ahead @ turn
        headings = headings + yaw
        aside = np.stack([-np.sin(headings), np.cos(headings), np.zeros_like(headings)], axis=1)
        points.append((middle + left_m * aside)[1 if points else 0 :])
        place = middle[-1]
        yaw += segment.sweep_rad or 0.0
    return np.concatenate(points)


def sine_length_m(length_m: float, amplitude_m: float, wavelength_m: float) -> float:
    """The length along a sine whose axis is `length_m` long."""
    x = np.linspace(0.0, length_m, 1 + 200 * math.ceil(length_m / wavelength_m))
    y = amplitude_m * np.sin(2.0 * math.pi * x / wavelength_m)
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def _shape(segment: Segment, step_m: float, step_rad: float) -> tuple[Array, Array]:
    """A segment from the origin along x: points (N, 3), and headings (N,) there."""
    if segment.radius_m is not None and segment.sweep_rad is not None:
        count = max(_steps(segment.length_m, step_m), _steps(abs(segment.sweep_rad), step_rad))
        share = np.linspace(0.0, 1.0, 1 + count)
        headings = segment.sweep_rad * share
        side = math.copysign(segment.radius_m, segment.sweep_rad)
        x, y = side * np.sin(headings), side * (1.0 - np.cos(headings))
    elif segment.amplitude_m is not None and segment.wavelength_m is not None:
        count = _steps(segment.length_m, min(step_m, segment.wavelength_m / 40.0))
        share = np.linspace(0.0, 1.0, 1 + count)
        slope = 2.0 * math.pi / segment.wavelength_m
        x = share * _axis_m(segment, segment.amplitude_m, segment.wavelength_m)
        y = segment.amplitude_m * np.sin(slope * x)
        headings = np.arctan(segment.amplitude_m * slope * np.cos(slope * x))
    else:
        share = np.linspace(0.0, 1.0, 1 + _steps(segment.length_m, step_m))
        x = share * math.sqrt(segment.length_m**2 - segment.climb_m**2)
        y = headings = np.zeros_like(share)
    return np.stack([x, y, share * segment.climb_m], axis=1), headings


def _axis_m(segment: Segment, amplitude_m: float, wavelength_m: float) -> float:
    """The length of a sine's axis; a sine ends where it crosses that."""
    half_m = sine_length_m(wavelength_m / 2.0, amplitude_m, wavelength_m)
    return wavelength_m / 2.0 * segment.length_m / half_m


def _steps(whole: float, step: float) -> int:
    return max(1, math.ceil(whole / step - 1e-9))
