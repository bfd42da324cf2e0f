"""How long one window takes on one thread, in the process that serves it."""

from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_S, Clock
from services.classifier.model import Model
from services.classifier.window import WINDOW_SAMPLES

WARM_UP = 200
FULL_YAW_RADPS = 1.0


@dataclass(frozen=True)
class Latency:
    """Of the longest window, the worst case.

    Attributes:
        p50_s: median.
        p99_s: 99 of 100 are faster.
        count: windows.
    """

    p50_s: float
    p99_s: float
    count: int


def latency(model: Model, clock: Clock, count: int) -> Latency:
    """Ask a model `count` times about the longest windows."""
    rng = np.random.default_rng(0)
    windows = rng.uniform(-1.0, 1.0, (32, WINDOW_SAMPLES, 4)).astype(np.float32)
    taken = []
    for turn in range(WARM_UP + count):
        window = windows[turn % len(windows)]
        begin_ns = clock.monotonic_ns()
        model.answer(window, FULL_YAW_RADPS)
        taken.append(clock.monotonic_ns() - begin_ns)
    p50, p99 = np.percentile(np.array(taken[WARM_UP:]) / NS_PER_S, [50, 99])
    return Latency(float(p50), float(p99), count)
