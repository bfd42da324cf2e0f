"""Hand-made geometry features: what a person would measure of a motion to name its shape.

The sticks are velocities, so their sum is a path. Features do not change when the motion is turned
about z or mirrored, so that a tree need not learn each direction.
"""

import math

import numpy as np
from numpy.typing import NDArray

from services.classifier.window import MODEL_RATE_HZ

Array = NDArray[np.float64]

SMOOTH_SAMPLES = 9
"""0.18 s: above tremor's period, below the quickest gesture's."""
STILL = 0.1
"""Below this deflection a direction is mostly noise."""
STRAIGHT_RADPS = 0.12
"""Slower turns count for no side, so that a line has no inflections."""
TINY = 1e-9

NAMES = (
    "duration_s",
    "speed",
    "speed_variation",
    "speed_lowest",
    "climb_share",
    "climb_net",
    "climb_one_way",
    "climb_variation",
    "climb_steadiness",
    "straightness",
    "straightness_3d",
    "turn_net",
    "turn_total",
    "turn_one_way",
    "turn_rate",
    "turn_rate_variation",
    "turn_rate_first_half",
    "turn_rate_second_half",
    "inflections",
    "inflection_first",
    "heading_range",
    "heading_line_residual",
    "heading_parabola_gain",
    "heading_middle_offset",
    "circle_residual",
    "circle_sweep",
    "circle_radius",
    "axes_ratio",
    "chord_distance",
    "chord_crossings",
    "axis_crossings",
    "area",
    "area_one_way",
    "across_peak_share",
    "across_peak_cycles",
    "velocity_variation_x",
    "velocity_variation_y",
    "velocity_correlation",
)


def _smoothed(sticks: Array) -> Array:
    """Running means over time, of what there is at the ends."""
    taps = min(SMOOTH_SAMPLES, len(sticks))
    kernel = np.ones(taps)
    share = np.convolve(np.ones(len(sticks)), kernel, "same")
    return np.stack([np.convolve(c, kernel, "same") / share for c in sticks.T], axis=1)


def _circle(x: Array, y: Array) -> tuple[float, float, float]:
    """Centre and radius of the circle of least algebraic distance (Kasa 1976)."""
    rows = np.stack([x, y, np.ones_like(x)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(rows, x * x + y * y, rcond=1e-8)
    return a / 2.0, b / 2.0, math.sqrt(max(c + (a * a + b * b) / 4.0, TINY))


def _changes(signs: Array) -> NDArray[np.int64]:
    """Where a sequence of -1, 0 and 1 goes to the other side; zeros belong to no side."""
    sided = np.flatnonzero(signs)
    return np.asarray(sided[1:][np.diff(signs[sided]) != 0.0])


def features(sticks: Array) -> Array:
    """Features (len(NAMES),) of a motion.

    Args:
        sticks: (N, 3) vx vy vz at `MODEL_RATE_HZ` in a frame that does not turn, N >= 2.
    """
    v = _smoothed(np.asarray(sticks, dtype=np.float64))
    count = len(v)
    vx, vy, vz = v.T
    flat = np.hypot(vx, vy)
    speed = np.sqrt(flat**2 + vz**2)
    total, total_flat = speed.sum() + TINY, flat.sum() + TINY
    mean_speed = total / count
    climb_total = np.abs(vz).sum() + TINY

    x, y = np.cumsum(vx), np.cumsum(vy)
    chord_x, chord_y = x[-1], y[-1]
    chord = math.hypot(chord_x, chord_y)
    straight = chord / total_flat
    straight_3d = math.sqrt(chord**2 + vz.sum() ** 2) / total

    # Turns between samples; those of a resting stick count for little.
    cross = vx[:-1] * vy[1:] - vy[:-1] * vx[1:]
    turn = np.arctan2(cross, vx[:-1] * vx[1:] + vy[:-1] * vy[1:] + TINY)
    energy = flat[:-1] * flat[1:]
    turn = turn * energy / (energy + STILL**2)
    if turn.sum() < 0.0:
        turn, y, vy, chord_y, cross = -turn, -y, -vy, -chord_y, -cross
    rate = np.convolve(turn, np.ones(SMOOTH_SAMPLES) / SMOOTH_SAMPLES, "same")[: len(turn)]
    rate = rate * MODEL_RATE_HZ
    turned, net = np.abs(turn).sum() + TINY, turn.sum()
    sides = np.where(np.abs(rate) > STRAIGHT_RADPS, np.sign(rate), 0.0)
    inflections = _changes(sides)
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    at = np.linspace(-1.0, 1.0, count)
    linear = np.polynomial.legendre.legfit(at, heading, min(2, count - 1))
    off_line = float(np.std(heading - np.polynomial.legendre.legval(at, linear[:2])))
    third = max(1, count // 3)
    ends = 0.5 * (heading[:third].mean() + heading[-third:].mean())

    centre_x, centre_y, radius = _circle(x, y)
    distance = np.hypot(x - centre_x, y - centre_y)
    bearing = np.unwrap(np.arctan2(y - centre_y, x - centre_x))

    middle = np.stack([x - x.mean(), y - y.mean()])
    (minor, major), axes = np.linalg.eigh(middle @ middle.T / count)
    across = axes[:, 0] @ middle
    from_chord = (chord_x * y - chord_y * x) / (chord + TINY)
    hysteresis = 0.02 * total_flat
    areas = 0.5 * (x[:-1] * vy[1:] - y[:-1] * vx[1:])
    spectrum = np.abs(np.fft.rfft((across - across.mean()) * np.hanning(count))) ** 2
    peak = int(spectrum[1:].argmax()) + 1 if len(spectrum) > 1 else 0
    along = axes[:, 1] @ np.stack([vx, vy])
    side = axes[:, 0] @ np.stack([vx, vy])

    return np.array(
        [
            count / MODEL_RATE_HZ,
            mean_speed,
            speed.std() / mean_speed,
            speed.min() / mean_speed,
            climb_total / total,
            abs(vz.sum()) / total,
            abs(vz.sum()) / climb_total,
            vz.std() / mean_speed,
            abs(vz.mean()) / (vz.std() + 0.02),
            straight,
            straight_3d,
            net,
            turned,
            net / turned,
            net / count * MODEL_RATE_HZ,
            rate.std() if len(rate) else 0.0,
            rate[: len(rate) // 2].mean() if len(rate) > 1 else 0.0,
            rate[len(rate) // 2 :].mean() if len(rate) > 1 else 0.0,
            len(inflections),
            inflections[0] / count if len(inflections) else 1.0,
            np.ptp(heading),
            off_line,
            abs(linear[2]) if len(linear) > 2 else 0.0,
            heading[third : 2 * third + 1].mean() - ends,
            np.sqrt(np.mean((distance - radius) ** 2)) / total_flat,
            abs(bearing[-1] - bearing[0]),
            math.log(radius / total_flat + TINY),
            math.sqrt(max(minor, 0.0) / (major + TINY)),
            np.abs(from_chord).max() / total_flat,
            len(_changes(np.where(np.abs(from_chord) > hysteresis, np.sign(from_chord), 0.0))),
            len(_changes(np.where(np.abs(across) > hysteresis, np.sign(across), 0.0))),
            areas.sum() / total_flat**2,
            areas.sum() / (np.abs(areas).sum() + TINY),
            spectrum[peak] / (spectrum.sum() + TINY),
            float(peak),
            along.std() / mean_speed,
            side.std() / mean_speed,
            float(np.mean(along * side) - along.mean() * side.mean()) / mean_speed**2,
        ]
    )
