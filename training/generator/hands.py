"""Hands: from a meant push to what thumbs make of it and a pad sends. Rows are performances."""

import math

import numpy as np
from numpy.typing import NDArray

from common.sticks import FULL_STICK
from training.generator.noise import STEP_S, Array, pulses, slow, tremor, wander
from training.generator.people import People
from training.generator.shapes import Shapes

FULL_UP_MPS = FULL_STICK["tum"].up_mps
FULL_YAW_RADPS = FULL_STICK["tum"].yaw_radps
"""Of the vehicle that simulated people fly; forward and sideways it makes 1 m/s."""
LEAD_OUT_SHARE = 0.6
"""Those who let go of the stick before they press the stop button."""
YAW_ALSO_SHARE = 0.3


def towards_axes(vx: Array, vy: Array, pull: Array) -> tuple[Array, Array]:
    """Pushes drawn towards the nearest axis by a share of their angle to it."""
    angle = np.arctan2(vy, vx)
    nearest = np.round(angle / (math.pi / 2)) * (math.pi / 2)
    # Weakest half-way between two axes, where neither is near.
    drawn = angle + pull * np.cos(2.0 * (angle - nearest)) * (nearest - angle)
    level = np.hypot(vx, vy)
    return level * np.cos(drawn), level * np.sin(drawn)


def stepped(vx: Array, vy: Array, steps: Array) -> tuple[Array, Array]:
    """Pushes drawn towards the nearest of eight directions, with more than half a push full."""
    angle, level = np.arctan2(vy, vx), np.hypot(vx, vy)
    eighth = np.round(angle / (math.pi / 4)) * (math.pi / 4)
    angle = angle + steps * (eighth - angle)
    level = level + steps * 0.5 * (np.where(level > 0.3, 1.0, 0.0) - level)
    return level * np.cos(angle), level * np.sin(angle)


def taps(people: People, count: int, rng: np.random.Generator) -> Array:
    """(n, count) 1 while pushing, 0 between taps."""
    phase = np.arange(count) * STEP_S / people.tap_s[:, None] + rng.random((len(people), 1))
    return np.where(phase % 1.0 < 1.0 - people.tap[:, None], 1.0, 0.0)


def neuromuscular(wanted: Array, people: People) -> Array:
    """Sticks (n, k, 4) after the two lags of arm and thumb, from neutral."""
    keep = np.exp(-STEP_S / people.lag_s)[:, None]
    out = np.empty_like(wanted)
    first = np.zeros((len(people), 4))
    second = np.zeros((len(people), 4))
    for i in range(wanted.shape[1]):
        first = keep * first + (1.0 - keep) * wanted[:, i]
        second = keep * second + (1.0 - keep) * first
        out[:, i] = second
    return out


def held(wanted: Array, people: People) -> Array:
    """Sticks (n, k, 4) of thumbs that stay until they should be elsewhere by more than `hold`."""
    out = np.empty_like(wanted)
    now = np.zeros((len(people), 4))
    hold = people.hold[:, None]
    for i in range(wanted.shape[1]):
        now = np.where(
            (np.abs(wanted[:, i] - now) > hold) | (wanted[:, i] == 0.0), wanted[:, i], now
        )
        out[:, i] = now
    return out


def noisy(sticks: Array, people: People, rng: np.random.Generator) -> Array:
    """Sticks (n, k, 4) with noise in proportion to the push."""
    n, count = sticks.shape[:2]
    noise = np.stack([slow(n, count, 0.12, rng) for _ in range(4)], axis=2)
    return np.asarray(sticks * (1.0 + people.signal_noise[:, None, None] * noise))


def shaken(sticks: Array, people: People, rng: np.random.Generator) -> Array:
    """Sticks (n, k, 4) with tremor on the axes in use."""
    used = np.abs(sticks).max(axis=1) > 0.05
    shaken = sticks.copy()
    for axis in range(4):
        rows = np.flatnonzero(used[:, axis])
        shake = tremor(people.tremor_hz[rows], sticks.shape[1], rng)
        shaken[rows, :, axis] += shake * people.tremor[rows, None]
    return shaken


def finished(wanted: Array, people: People, rng: np.random.Generator) -> Array:
    """What hands make of pushes (n, k, 4) that are wanted: held, late, noisy, trembling."""
    return shaken(noisy(neuromuscular(held(wanted, people), people), people, rng), people, rng)


def alive(sticks: Array, dead_band: Array) -> Array:
    """Sticks without those within the dead band: what leaves a pad."""
    return np.where(np.abs(sticks) < dead_band, 0.0, sticks)


def paced(people: People, samples: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """Progress (n, k) from 0 to 1 at `samples` (n,), at an uneven pace with stops."""
    n, count = len(people), int(samples.max())
    pace = np.clip(1.0 + people.warp[:, None] * wander(n, count, rng), 0.2, 2.2)
    stops = pulses(people.hesitation_hz, count, (0.1, 0.5), 1.0, rng)
    phase = np.cumsum(np.where(stops != 0.0, 0.0, pace), axis=1)
    end = phase[np.arange(n), samples - 1]
    return np.asarray(phase / np.maximum(end, 1.0)[:, None])


def draw(
    shapes: Shapes, people: People, rng: np.random.Generator
) -> tuple[Array, NDArray[np.int64]]:
    """Sticks of hands that perform shapes without watching the vehicle.

    Returns:
        (n, k, 4) at `STEP_S` and how many of the k samples belong to each performance.
    """
    n = len(people)
    samples = np.round(shapes.duration_s / STEP_S).astype(np.int64)
    progress = np.minimum(paced(people, samples, rng), 1.0)
    count = progress.shape[1]
    time_s = np.arange(count) * STEP_S
    meant = shapes.direction(progress)
    astray = people.wander_rad[:, None] * wander(n, count, rng)
    astray += pulses(people.correction_hz, count, (0.1, 0.35), 0.35, rng)

    flat = ~shapes.vertical[:, None]
    by_yaw = np.where(shapes.vertical, 0.0, people.yaw)[:, None]
    turning = np.diff(meant, axis=1, prepend=meant[:, :1]) / STEP_S / FULL_YAW_RADPS
    turn = by_yaw * turning + np.where(by_yaw > 0.0, astray * 0.8, 0.0)
    angle = meant - by_yaw * (meant - meant[:, :1]) + np.where(by_yaw > 0.5, 0.3, 1.0) * astray

    ramp = np.clip(time_s / people.ramp_s[:, None], 0.0, 1.0)
    fade = 1.0 + people.drift[:, None] * rng.standard_normal((n, 1)) * progress
    push = people.push * np.exp(0.2 * rng.standard_normal(n))
    level = push[:, None] * shapes.speed(progress) * ramp * np.clip(fade, 0.4, 1.6)
    plane = shapes.plane_rad[:, None]
    along, across = level * np.cos(angle), level * np.sin(angle)
    vx = np.where(flat, along, along * np.cos(plane))
    vy = np.where(flat, across, along * np.sin(plane))
    ratio = np.exp(0.5 * people.imbalance * rng.standard_normal(n))[:, None]
    vx, vy = towards_axes(vx * ratio, vy / ratio, people.axis_pull[:, None])
    vx, vy = stepped(vx, vy, people.steps[:, None])

    climb = np.where(flat, shapes.climbing(progress) * level, across)
    late = time_s >= (people.late_s * rng.random(n))[:, None]
    climb = np.where(late, climb, 0.0) * (1.0 + 0.15 * wander(n, count, rng))
    climb += people.cross_talk[:, None] * vx * slow(n, count, 0.5, rng)
    climb += pulses(people.height_hz, count, (0.15, 0.7), 0.25, rng)
    leak = people.cross_talk * (rng.random(n) < YAW_ALSO_SHARE)
    turn = turn + leak[:, None] * vy * slow(n, count, 0.5, rng)

    wanted = np.stack([vx, vy, climb, turn], axis=2) * taps(people, count, rng)[:, :, None]
    released = released_at(samples, people, rng)
    wanted, samples = lead_out(wanted, samples, released, people)
    return finished(wanted, people, rng), samples


def released_at(
    samples: NDArray[np.int64], people: People, rng: np.random.Generator
) -> NDArray[np.int64]:
    """How many samples (n,) of letting go each performance has before the stop button."""
    out_s = rng.uniform(0.04, 1.0, len(people)) * people.ramp_s
    some = rng.random(len(people)) < LEAD_OUT_SHARE
    return np.where(some, np.round(out_s / STEP_S), 0).astype(np.int64)


def lead_out(
    wanted: Array,
    samples: NDArray[np.int64],
    released: NDArray[np.int64],
    people: People,
) -> tuple[Array, NDArray[np.int64]]:
    """Pushes (n, k, 4) that fade to neutral after their last sample, and their new lengths."""
    n = len(people)
    total = samples + released
    index = np.arange(int(total.max()))
    source = np.minimum(index[None], samples[:, None] - 1)
    after = np.maximum(index[None] - (samples[:, None] - 1), 0)
    fade = np.clip(1.0 - after / np.maximum(released, 1)[:, None], 0.0, 1.0)
    return wanted[np.arange(n)[:, None], source] * fade[:, :, None], total
