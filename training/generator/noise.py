"""Random signals of hands: slow wander, tremor, pulses. Rows are performances."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

STEP_S = 0.02
POINTS_PER_CONSTANT = 4.0
TREMOR_DEVIATION = math.sqrt(0.5 * (1.0 + 0.5**2) + 0.5**2)


def slow(rows: int, count: int, time_constant_s: float, rng: np.random.Generator) -> Array:
    """(rows, count) coloured noise of standard deviation about 1, at `STEP_S`."""
    # Drawn at a few points per time constant, and joined by lines: much cheaper than at each step.
    every = max(1, int(time_constant_s / STEP_S / POINTS_PER_CONSTANT))
    sigma = time_constant_s / STEP_S / every
    pad = int(3 * sigma) + 1
    coarse = (count - 1) // every + 2
    white = rng.standard_normal((rows, coarse + 2 * pad))
    smooth = gaussian_filter1d(white, sigma, axis=1, truncate=3.0)[:, pad : pad + coarse]
    smooth *= math.sqrt(2.0 * math.sqrt(math.pi) * sigma)
    if every == 1:
        return np.asarray(smooth[:, :count])
    at, between = np.divmod(np.arange(count), every)
    share = between / every
    return np.asarray(smooth[:, at] * (1.0 - share) + smooth[:, at + 1] * share)


def wander(rows: int, count: int, rng: np.random.Generator) -> Array:
    """(rows, count) noise of standard deviation 1, each row of its own mixture of time scales."""
    share = rng.random((rows, 1))
    mixed = share * slow(rows, count, 0.3, rng) + (1.0 - share) * slow(rows, count, 0.9, rng)
    return np.asarray(mixed / np.sqrt(share**2 + (1.0 - share) ** 2))


def tremor(frequency_hz: Array, count: int, rng: np.random.Generator) -> Array:
    """(rows, count) tremor of standard deviation about 1, its frequency and strength wandering."""
    rows = len(frequency_hz)
    phase = 2.0 * math.pi * STEP_S * frequency_hz[:, None] * np.arange(count)
    phase += rng.uniform(0.0, 2.0 * math.pi, (rows, 1)) + 0.8 * slow(rows, count, 0.1, rng)
    strength = 1.0 + 0.5 * slow(rows, count, 0.3, rng)
    shake = strength * np.sin(phase) + 0.5 * rng.standard_normal((rows, count))
    return np.asarray(shake / TREMOR_DEVIATION)


def pulses(
    rate_hz: Array,
    count: int,
    length_s: tuple[float, float],
    size: float,
    rng: np.random.Generator,
) -> Array:
    """(rows, count) sums of rectangular pulses at random times.

    Args:
        rate_hz: (rows,) how many a second.
        count: samples.
        length_s: shortest and longest pulse.
        size: standard deviation of their heights.
        rng: source of it all.
    """
    rows = len(rate_hz)
    row = np.repeat(np.arange(rows), rng.poisson(rate_hz * count * STEP_S))
    begin = rng.integers(0, count, len(row))
    samples = np.maximum(1, np.round(rng.uniform(*length_s, len(row)) / STEP_S)).astype(np.int64)
    height = size * rng.standard_normal(len(row))
    edges = np.zeros((rows, count + 1))
    np.add.at(edges, (row, begin), height)
    np.add.at(edges, (row, np.minimum(begin + samples, count)), -height)
    return np.asarray(np.cumsum(edges, axis=1)[:, :count])
