"""Waypoints one after the other: the thesis' queue of gotos, and tum_ardrone's own rule.

The thesis' Algorithm 1 samples a path at N = 64 places and queues a `goto` of each (its sign and
its half lap are put right, see docs/thesis.md). They are flown by tum_ardrone 6bcfb34: a PID from
the error to the stick, and a waypoint is reached within 0.2 m. On its own, tum_ardrone then stays
there for 2 s; the queue goes on at once.
"""

import math
from dataclasses import dataclass

import numpy as np

from common.frames import world_to_heading, wrap_angle, yaw_of
from common.messages import Pose, Suggestion
from services.autopilot.config import Config
from services.autopilot.control import Controller, Sticks
from services.autopilot.path import Path

COMMANDS = 64
REACHED_M = 0.2
STAY_S = 2.0


@dataclass(frozen=True)
class Gains:
    """tum_ardrone's defaults, in sticks a metre, a m/s, a metre second.

    Its vertical P is asymmetric on the real drone's account, as are its limits (+0.8, -0.25 of the
    stick here); yaw is 0.05 a degree.
    """

    plane_p: float = 0.5
    plane_d: float = 0.35
    up_p: float = 0.6
    up_d: float = 0.1
    up_i: float = 0.001
    rise_limit: float = 0.8
    sink_limit: float = 0.25
    yaw_p: float = 0.05 * 180.0 / math.pi


class GotoQueue:
    """Flies a queue of gotos.

    Args:
        suggestion: what was accepted.
        pose: where the vehicle is.
        controller: of the vehicle; its own model of the plant is not used.
        config: limits of the autopilot; not used.
        stay_s: how long it stays at each.
        ahead_m: each goto is given up for the next when it is nearer than this along the path; the
            last one is reached like any.
    """

    def __init__(
        self,
        suggestion: Suggestion,
        pose: Pose,
        controller: Controller,
        config: Config,
        *,
        stay_s: float = 0.0,
        ahead_m: float = 0.0,
    ) -> None:
        self.suggestion = suggestion
        self._gains = Gains()
        self._ahead_m = ahead_m
        self._stay_s = stay_s
        self._path = Path(suggestion.path, suggestion.closed)
        self._distance_m = 0.0
        self._target = 1
        self._stayed_s = 0.0
        self._up_integral = 0.0
        self.cross_track_m = 0.0

    @property
    def progress_m(self) -> float:
        """How far it flew along the path; laps add up."""
        return self._distance_m

    @property
    def finished(self) -> bool:
        """Whether the last goto of an open path is reached."""
        return not self.suggestion.closed and self._target > COMMANDS

    def sticks(self, pose: Pose, age_s: float, dt_s: float) -> Sticks:
        """The sticks for now; arguments as of the follower's."""
        gains = self._gains
        self._distance_m = self._path.advanced_m(self._distance_m, pose.position)
        nearest = self._path.at(self._distance_m)
        self.cross_track_m = math.dist(nearest.position_m, pose.position)
        target_m = self._target * self._path.length_m / COMMANDS
        target = self._path.at(target_m)
        error = [t - p for t, p in zip(target.position_m, pose.position, strict=True)]
        if math.hypot(*error) < REACHED_M or self._stayed_s > 0.0:
            self._stayed_s += dt_s
            if self._stayed_s >= self._stay_s:
                self._target += 1
                self._stayed_s = 0.0
        elif target_m - self._distance_m < self._ahead_m and (
            self.suggestion.closed or self._target < COMMANDS
        ):
            self._target += 1
        yaw_rad = yaw_of(pose.orientation)
        east, north = (
            gains.plane_p * error[axis] - gains.plane_d * pose.velocity[axis] for axis in (0, 1)
        )
        forward, left = world_to_heading(east, north, yaw_rad)
        self._up_integral += error[2] * dt_s
        up = gains.up_p * error[2] + gains.up_i * self._up_integral - gains.up_d * pose.velocity[2]
        turn = gains.yaw_p * wrap_angle(target.yaw_rad - yaw_rad)
        return Sticks(
            float(np.clip(forward, -1.0, 1.0)),
            float(np.clip(left, -1.0, 1.0)),
            float(np.clip(up, -gains.sink_limit, gains.rise_limit)),
            float(np.clip(turn, -1.0, 1.0)),
        )


def waypoints(
    suggestion: Suggestion, pose: Pose, controller: Controller, config: Config
) -> GotoQueue:
    """tum_ardrone's own rule: within 0.2 m, then 2 s."""
    return GotoQueue(suggestion, pose, controller, config, stay_s=STAY_S)


def hurried(
    suggestion: Suggestion, pose: Pose, controller: Controller, config: Config
) -> GotoQueue:
    """The queue at the suggestion's speed: each goto is given up for the next while still far off.

    As published the queue creeps, since its P sees at most 0.2 m and the way to the next goto. A
    vehicle flies at v where the P asks for what the D takes away and v needs.
    """
    plane = controller.plant.plane
    ahead_m = suggestion.speed * (Gains.plane_d + 1.0 / plane.speed) / Gains.plane_p
    return GotoQueue(suggestion, pose, controller, config, ahead_m=ahead_m)
