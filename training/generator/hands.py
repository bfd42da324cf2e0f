"""From a meant velocity to sticks: what an arm, a thumb and a pad make of it."""

import math

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from training.generator.operators import Operator
from training.generator.shapes import Array

STEP_S = 0.02
TREMOR_HZ = 9.0


def slow_noise(count: int, time_constant_s: float, rng: np.random.Generator) -> Array:
    """(count,) coloured noise of standard deviation 1 over its own length, at `STEP_S`."""
    sigma = time_constant_s / STEP_S
    pad = int(4 * sigma) + 1
    white = rng.standard_normal(count + 2 * pad)
    smooth = gaussian_filter1d(white, sigma)[pad : pad + count]
    return np.asarray(smooth * math.sqrt(2.0 * math.sqrt(math.pi) * sigma))


def lagged(values: Array, time_constant_s: float) -> Array:
    """Values (N, k) after a first-order lag, from rest."""
    keep = math.exp(-STEP_S / max(time_constant_s, 1e-3))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, axis=0))


def tremor(count: int, who: Operator, rng: np.random.Generator) -> Array:
    """(count,) tremor about `TREMOR_HZ` with a wandering amplitude."""
    phase = 2.0 * math.pi * TREMOR_HZ * STEP_S * np.arange(count) + 0.8 * slow_noise(
        count, 0.1, rng
    )
    strength = 0.6 + 0.4 * slow_noise(count, 0.3, rng)
    white = 0.4 * rng.standard_normal(count)
    return who.tremor * (strength * np.sin(phase + rng.uniform(0, 6.3)) + white)


def on_pad(sticks: Array, who: Operator) -> Array:
    """Sticks (N, k) as the pad sends them: dead band, clipped to full stick."""
    return np.clip(np.where(np.abs(sticks) < who.dead_band, 0.0, sticks), -1.0, 1.0)


def towards_axes(vx: Array, vy: Array, pull: float) -> tuple[Array, Array]:
    """Directions drawn towards the nearest axis by a share of their distance to it."""
    angle = np.arctan2(vy, vx)
    nearest = np.round(angle / (math.pi / 2)) * (math.pi / 2)
    # Weakest half-way between two axes, where neither is near.
    strength = pull * np.cos(2.0 * (angle - nearest))
    drawn = angle + strength * (nearest - angle)
    level = np.hypot(vx, vy)
    return level * np.cos(drawn), level * np.sin(drawn)


def height_pulses(count: int, who: Operator, rng: np.random.Generator) -> Array:
    """(count,) single corrections of the height, as shares of the vertical stick."""
    pulses = np.zeros(count)
    for _ in range(rng.poisson(who.height_hz * count * STEP_S)):
        # Often at the beginning, when the eyes are free for it.
        begin = int(rng.integers(0, count)) if rng.random() < 0.7 else int(rng.integers(0, 25))
        end = begin + int(rng.uniform(0.15, 0.9) / STEP_S)
        pulses[begin:end] += rng.choice((-1.0, 1.0)) * rng.uniform(0.1, 0.5)
    return pulses


def _warped(plan: Array, who: Operator, rng: np.random.Generator) -> Array:
    """The plan (N, 3) run through unevenly, with stops."""
    count = len(plan)
    pace = np.clip(1.0 + who.warp * slow_noise(count, 0.5, rng), 0.3, 2.0)
    for _ in range(rng.poisson(who.hesitation_hz * count * STEP_S)):
        begin = int(rng.integers(0, count))
        pace[begin : begin + int(rng.uniform(0.1, 0.4) / STEP_S)] = 0.0
    phase = np.cumsum(pace)
    phase *= (count - 1) / max(float(phase[-1]), 1.0)
    index = np.arange(count)
    return np.stack([np.interp(phase, index, plan[:, k]) for k in range(3)], axis=1)


def _corrected(angle: Array, who: Operator, rng: np.random.Generator) -> Array:
    """Directions (N,) with slow wander and short corrections."""
    count = len(angle)
    angle = angle + who.wander_rad * slow_noise(count, 0.6, rng)
    for _ in range(rng.poisson(who.correction_hz * count * STEP_S)):
        begin = int(rng.integers(0, count))
        end = begin + int(rng.uniform(0.1, 0.35) / STEP_S)
        angle[begin:end] += rng.normal(0.0, 0.25)
    return angle


def hand(plan: Array, who: Operator, rng: np.random.Generator) -> Array:
    """Sticks (N, 4) at `STEP_S` of a hand that performs a plan (M, 3) without watching."""
    meant = _warped(plan, who, rng)
    count = len(meant)
    level = np.hypot(meant[:, 0], meant[:, 1])
    angle = _corrected(np.unwrap(np.arctan2(meant[:, 1], meant[:, 0])), who, rng)
    if who.steps > 0.0:
        stepped = np.round(angle / (math.pi / 4)) * (math.pi / 4)
        angle = angle + who.steps * (stepped - angle)
    ramp_in = np.clip(np.arange(count) * STEP_S / who.ramp_s, 0.0, 1.0)
    fade = 1.0 + rng.normal(0.0, who.drift) * np.linspace(0.0, 1.0, count)
    dips = np.clip(1.0 + who.signal_noise * slow_noise(count, 0.25, rng), 0.2, 1.6)
    envelope = ramp_in * np.clip(fade, 0.4, 1.6) * dips
    vx, vy = level * envelope * np.cos(angle), level * envelope * np.sin(angle)
    ratio = math.exp(rng.normal(0.0, who.imbalance))
    vx, vy = towards_axes(vx * math.sqrt(ratio), vy / math.sqrt(ratio), who.axis_pull)
    up_noise = 1.0 + 1.5 * who.signal_noise * slow_noise(count, 0.3, rng)
    vz = meant[:, 2] * envelope * up_noise + who.cross_talk * vx * slow_noise(count, 0.5, rng)
    if rng.random() < 0.5:
        # The other thumb is often later.
        late = int(rng.uniform(0.0, 0.4) / STEP_S)
        vz = np.concatenate([np.zeros(late), vz])[:count]
    if level.any():
        vz = vz + height_pulses(count, who, rng)
    sticks = np.stack([vx, vy, vz, np.zeros(count)], axis=1)
    if rng.random() < 0.6:
        out = int(rng.uniform(0.04, who.ramp_s) / STEP_S)
        tail = sticks[-1] * np.linspace(1.0, 0.1, out)[:, None]
        sticks = np.concatenate([sticks, tail])
    sticks = lagged(lagged(sticks, who.lag_s), who.lag_s)
    active = np.abs(sticks).max(axis=0) > 0.05
    for axis in np.flatnonzero(active):
        sticks[:, axis] += tremor(len(sticks), who, rng)
    return on_pad(sticks, who)
