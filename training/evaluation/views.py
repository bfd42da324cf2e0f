"""What classifiers without a graph of their own are shown of a window of raw sticks."""

import numpy as np
from numpy.typing import NDArray

from services.classifier.window import MODEL_RATE_HZ
from training.windows import Windows

Array32 = NDArray[np.float32]


EVERY_WINDOWS = 3
"""Of all windows, those who learn slowly are shown one in so many."""


def thinned(windows: Windows) -> Windows:
    """Every third window, for classifiers that would learn for too long from all of them."""
    some = slice(None, None, EVERY_WINDOWS)
    sticks, times_s = windows.sticks[some], windows.times_s[some]
    return Windows(sticks, times_s, windows.lengths[some], windows.labels[some])


def in_start_frame(windows: Windows, full_yaw_radps: float) -> Array32:
    """Sticks (n, T, 3) vx vy vz in the frame of the heading at each window's start.

    An operator who flies a curve by forward and yaw holds the stick still; only in a frame that
    does not turn with the vehicle is that an arc. Our network does the same inside its graph.
    """
    sticks = windows.sticks
    # A stick is held until the next one comes, so a step turns by the stick at its beginning.
    held = np.zeros_like(sticks[:, :, 3])
    held[:, 1:] = sticks[:, :-1, 3]
    yaw = np.cumsum(held, axis=1) * (full_yaw_radps / MODEL_RATE_HZ)
    c, s = np.cos(yaw), np.sin(yaw)
    vx, vy = sticks[:, :, 0], sticks[:, :, 1]
    turned = np.stack([c * vx - s * vy, s * vx + c * vy, sticks[:, :, 2]], axis=2)
    inside = np.arange(sticks.shape[1])[None, :, None] < windows.lengths[:, None, None]
    return np.where(inside, turned, 0.0).astype(np.float32)


def padded(windows: Windows, full_yaw_radps: float, samples: int, every: int = 1) -> Array32:
    """Series (n, 3, samples / every) for models of fixed length: zero after a window's own.

    Args:
        windows: what to show.
        full_yaw_radps: the vehicle's yaw rate at full stick.
        samples: how many are shown, the newest of longer windows.
        every: how many samples are averaged to one.
    """
    sticks = in_start_frame(windows, full_yaw_radps)
    series = np.zeros((len(sticks), 3, samples), dtype=np.float32)
    for row, (one, length) in enumerate(zip(sticks, windows.lengths.tolist(), strict=True)):
        newest = one[max(0, length - samples) : length]
        series[row, :, : len(newest)] = newest.T
    means = series.reshape(len(series), 3, samples // every, every).mean(axis=3)
    return np.asarray(means, dtype=np.float32)
