"""What the vehicle did lately, as far as poses tell: points equally spaced along the way flown."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from common.clock import nanoseconds, seconds
from common.frames import Array, yaw_of
from common.messages import Pose

SPAN_S = 40.0
"""Longer than any window of the classifier; long enough for two lengths of a lawn."""
CELL_M = 0.05
"""Poses within this length of the way become one point, so that slow parts do not weigh more."""
SMOOTH_S = 0.1
"""Length of the way is measured over means of this time; noise of single poses would add to it."""
SPEED_S = 1.0
"""The vehicle's present speed is its mean over this time; the velocity loop needs 0.4 s."""
VELOCITY_S = 0.6
"""The newest velocity is that of a parabola through this time's positions: no lag in curves."""
REST_MPS = 0.1
REST_S = 1.0
"""A vehicle that makes less way than this speed would for this time has ended its motion."""
HELD_S, HELD_LEAST_S = 6.0, 1.5
HELD_M, HELD_MPS = 1.0, 0.4
"""A vehicle that stayed within this of its mean place and of where it was for `HELD_S`, or as long
as is known but at least the second time, and made no more way than at this speed, was held."""
HELD_FACTOR, HELD_MORE_M = 2.5, 0.1
"""Corrections take it no farther than this many times as far as it strayed before, and a little."""
GAP_S = 0.5
JUMP_M = 1.0
JUMP_MPS = 10.0
"""Poses further apart than `JUMP_M`, at more than this speed, are a reset, not a flight."""


@dataclass(frozen=True)
class Track:
    """The way flown in a window.

    Attributes:
        points_m: (N, 3), about `CELL_M` apart, oldest first.
        here_m: the newest position (3,).
        yaw_rad: the newest yaw.
        speed_mps: the recent mean speed.
        velocity_mps: the newest velocity (3,), world.
    """

    points_m: Array
    here_m: Array
    yaw_rad: float
    speed_mps: float
    velocity_mps: Array


class History:
    """A ring of poses by the time of their arrival; it starts anew where they stop making sense."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Pose]] = deque()

    def add(self, pose: Pose, arrival_ns: int) -> None:
        """Take in a pose; a lost one, a gap or a jump forgets what was before."""
        if self._poses:
            previous_ns, previous = self._poses[-1]
            elapsed_s = seconds(arrival_ns - previous_ns)
            jump_m = math.dist(pose.position, previous.position)
            lost = previous.status == "lost" or pose.status == "lost"
            if lost or elapsed_s > GAP_S or jump_m > max(JUMP_M, JUMP_MPS * elapsed_s):
                self._poses.clear()
        self._poses.append((arrival_ns, pose))
        while arrival_ns - self._poses[0][0] > nanoseconds(SPAN_S):
            self._poses.popleft()

    @property
    def newest(self) -> tuple[int, Pose] | None:
        """The newest pose and when it arrived."""
        return self._poses[-1] if self._poses else None

    def track(self, begin_ns: int, end_ns: int) -> Track | None:
        """The way flown by the poses that arrived within a window; None if there are under two."""
        chosen = self._between(begin_ns, end_ns)
        if len(chosen) < 2:
            return None
        time_s, position_m, way_m = _motion(chosen)
        return Track(
            _means(position_m, np.floor(way_m / CELL_M)),
            position_m[-1],
            yaw_of(chosen[-1][1].orientation),
            _recent_speed(time_s, way_m),
            _velocity(time_s, position_m),
        )

    def is_held(self, begin_ns: int, end_ns: int) -> bool:
        """Whether a window's motion has not left the place that the vehicle was held at before.

        Nobody's wind and thumbs are so still that a held vehicle goes nowhere, and corrections look
        like short lines and arcs. What tells them is that they lead nowhere new.
        """
        if not self._poses or begin_ns - self._poses[0][0] < nanoseconds(HELD_LEAST_S):
            return False
        time_s, before_m, way_m = _motion(self._between(begin_ns - nanoseconds(HELD_S), begin_ns))
        place_m = before_m.mean(axis=0)
        strayed_m = float(np.linalg.norm(before_m - place_m, axis=1).max())
        moved_m = float(np.linalg.norm(before_m[-1] - before_m[0]))
        flew = way_m[-1] > HELD_MPS * (time_s[-1] - time_s[0])
        if flew or max(strayed_m, moved_m) > HELD_M:
            return False
        now_m = [pose.position for _, pose in self._between(begin_ns, end_ns)]
        reached_m = max((math.dist(each_m, place_m) for each_m in now_m), default=0.0)
        return reached_m <= HELD_FACTOR * strayed_m + HELD_MORE_M

    def since_rest(self, end_ns: int) -> Array:
        """Points (N, 3) about `CELL_M` apart of the way flown since the vehicle last rested."""
        chosen = [(ns, pose) for ns, pose in self._poses if ns <= end_ns]
        if len(chosen) < 2:
            return np.empty((0, 3))
        time_s, position_m, way_m = _motion(chosen)
        before = np.searchsorted(time_s, time_s - REST_S)
        resting = way_m - way_m[before] < REST_MPS * REST_S
        resting &= time_s - time_s[0] >= REST_S
        first = int(np.flatnonzero(resting)[-1]) if resting.any() else 0
        way_m = way_m[first:] - way_m[first]
        return _means(position_m[first:], np.floor(way_m / CELL_M))

    def _between(self, begin_ns: int, end_ns: int) -> list[tuple[int, Pose]]:
        """The poses that arrived within a time, and when."""
        return [(ns, pose) for ns, pose in self._poses if begin_ns <= ns <= end_ns]


def _motion(chosen: list[tuple[int, Pose]]) -> tuple[Array, Array, Array]:
    """Times (N,) before the newest in s, positions (N, 3), the length of the way up to each."""
    time_s = np.array([seconds(ns - chosen[-1][0]) for ns, _ in chosen])
    position_m = np.array([pose.position for _, pose in chosen])
    return time_s, position_m, _way(time_s, position_m)


def _means(values: Array, labels: Array) -> Array:
    """Means (M, K) of the rows (N, K) that share a label; labels do not fall."""
    starts = np.flatnonzero(np.diff(labels, prepend=-1.0))
    counts = np.diff(starts, append=len(labels))
    return np.asarray(np.add.reduceat(values, starts, axis=0) / counts[:, None])


def _way(time_s: Array, position_m: Array) -> Array:
    """Length (N,) of the way flown up to each position."""
    labels = np.floor((time_s - time_s[0]) / SMOOTH_S)
    smooth = _means(np.column_stack([time_s, position_m]), labels)
    if len(smooth) < 2:
        return np.zeros(len(time_s))
    times, steps = smooth[:, 0], np.linalg.norm(np.diff(smooth[:, 1:], axis=0), axis=1)
    # Beyond the outer means the speed is that of the nearest step.
    segment = np.clip(np.searchsorted(times, time_s) - 1, 0, len(steps) - 1)
    into = (time_s - times[segment]) / np.diff(times)[segment]
    way = np.concatenate([[0.0], np.cumsum(steps)])[segment] + into * steps[segment]
    return np.asarray(way - way[0])


def _recent_speed(time_s: Array, way_m: Array) -> float:
    first = min(int(np.searchsorted(time_s, time_s[-1] - SPEED_S)), len(time_s) - 2)
    elapsed_s = float(time_s[-1] - time_s[first])
    return float(way_m[-1] - way_m[first]) / elapsed_s if elapsed_s > 0.0 else 0.0


def _velocity(time_s: Array, position_m: Array) -> Array:
    recent = time_s >= time_s[-1] - VELOCITY_S
    since_s = time_s[recent] - time_s[-1]
    basis = np.column_stack([np.ones(len(since_s)), since_s, since_s**2])
    weights, *_ = np.linalg.lstsq(basis, position_m[recent], rcond=None)
    return np.asarray(weights[1])
