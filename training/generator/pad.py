"""The pad: what it makes of hands, and when it sends it."""

import numpy as np
from numpy.typing import NDArray

from training.generator.hands import alive
from training.generator.noise import STEP_S, Array
from training.generator.people import People

STEPS = 127.0
"""An axis of a PS3 pad has 8 bits."""
WORN_MOST = 0.1
BEGUN = 0.05
"""Before the first push of more than this, nothing is being performed."""


def worn_offset(people: People, rng: np.random.Generator) -> Array:
    """How far from neutral (n, 4) the axes of these people's pads rest."""
    offset = people.worn[:, None] * rng.standard_normal((len(people), 4))
    return np.clip(offset, -WORN_MOST, WORN_MOST)


def read(
    sticks: Array,
    samples: NDArray[np.int64],
    offset: Array,
    people: People,
    rng: np.random.Generator,
    begun: bool,
) -> list[tuple[Array, Array]]:
    """Times (N,) and sticks (N, 4) of each performance, as messages of a pad.

    Args:
        sticks: (n, k, 4) at `STEP_S`.
        samples: (n,) how many of the k are the performance.
        offset: (n, 4) of worn pads.
        people: whose pads.
        rng: of intervals and losses.
        begun: whether to begin with the first push.
    """
    read = []
    for row in range(len(people)):
        own = sticks[row, : samples[row]]
        if begun:
            pushed = np.flatnonzero(np.abs(own).max(axis=1) > BEGUN)
            own = own[pushed[0] if len(pushed) else 0 :]
        rate_hz = people.rate_hz[row]
        duration_s = (len(own) - 1) * STEP_S
        intervals = 1.0 + people.jitter[row] * rng.standard_normal(int(duration_s * rate_hz) + 2)
        times_s = np.concatenate([[0.0], np.cumsum(np.clip(intervals, 0.3, 2.5) / rate_hz)])
        kept = (times_s <= duration_s) & (rng.random(len(times_s)) >= people.loss[row])
        kept[0] = True
        times_s = times_s[kept]
        grid_s = np.arange(len(own)) * STEP_S
        now = np.stack([np.interp(times_s, grid_s, own[:, k]) for k in range(4)], axis=1)
        now = alive(now + offset[row], people.dead_band[row])
        read.append((times_s, np.round(np.clip(now, -1.0, 1.0) * STEPS) / STEPS))
    return read
