"""Flies a path: which place of it is due now, how fast, and when it ends."""

import math
from typing import Protocol

import numpy as np

from common.frames import Array
from common.messages import Pose, Suggestion
from services.autopilot.config import Config
from services.autopilot.control import Controller, Reference, Sticks
from services.autopilot.fence import Fence
from services.autopilot.path import BadPathError, Path

FINISH_M = 0.1
"""An open path is finished this near to its end; the vehicle coasts about as far."""
MIN_SPEED_MPS = 0.15
"""Slowest path speed: the end of a path is reached, not approached for ever."""
SPEED_STEPS = 16
"""Speeds that are tried at each place of the path."""
REPLAN_S = 0.5
"""The speeds are planned anew this often, as the wind becomes known."""
PLAN_M = 20.0
"""As far ahead the speeds are planned: room to brake from 3.6 m/s, and until the next plan."""
SPEED_LEAD_MPS = 0.3
"""The speed asked for is at most this much above the vehicle's own: wind may hold it back."""
YAW_LOOK_S = 0.2
"""The change of the path's turn is taken over this time ahead."""


class PathFollower(Protocol):
    """What the autopilot needs of whoever flies an accepted suggestion."""

    suggestion: Suggestion
    cross_track_m: float

    @property
    def progress_m(self) -> float:
        """How far it flew along the path; laps add up."""
        ...

    @property
    def finished(self) -> bool:
        """Whether it is at the end of an open path."""
        ...

    def sticks(self, pose: Pose, age_s: float, dt_s: float) -> Sticks:
        """The sticks for now."""
        ...


class Follower:
    """The flight along one accepted suggestion.

    Args:
        suggestion: what was accepted.
        pose: where the vehicle is; the flight starts at the path's point nearest to it.
        controller: of the vehicle.
        config: limits.

    Raises:
        BadPathError: if the path cannot be flown from here: too short, too far, out of bounds.
    """

    def __init__(
        self, suggestion: Suggestion, pose: Pose, controller: Controller, config: Config
    ) -> None:
        self.suggestion = suggestion
        self._config = config
        self._controller = controller
        self._path = Path(suggestion.path, suggestion.closed)
        if not Fence(config).holds(self._path.points_m):
            raise BadPathError("geofence")
        self._start_m = self._path.nearest_start_m(pose.position, config.start_distance_m)
        self._distance_m = self._start_m
        here = self._path.at(self._distance_m)
        self.cross_track_m = math.dist(here.position_m, pose.position)
        if self.cross_track_m > config.start_distance_m:
            raise BadPathError("too_far")
        along = sum(v * t for v, t in zip(pose.velocity, here.tangent, strict=True))
        self._speed_mps = min(max(along, MIN_SPEED_MPS), suggestion.speed)
        self._planned_s = 0.0
        self._plan_sample, self._plan_mps = self._plan()

    @property
    def progress_m(self) -> float:
        """How far it flew along the path; laps add up."""
        return self._distance_m - self._start_m

    @property
    def finished(self) -> bool:
        """Whether it is at the end of an open path."""
        return not self._path.closed and self._path.length_m - self._distance_m <= FINISH_M

    def sticks(self, pose: Pose, age_s: float, dt_s: float) -> Sticks:
        """The sticks for now.

        Args:
            pose: the newest pose.
            age_s: how long ago it arrived; the pose is carried on by its speeds for so long.
            dt_s: time since the last call.
        """
        return self._controller.sticks(pose, age_s, self.reference(pose, age_s, dt_s), dt_s)

    def reference(self, pose: Pose, age_s: float, dt_s: float) -> Reference:
        """Where on the path the vehicle should be now; moves on along it. Arguments as above."""
        position = [p + v * age_s for p, v in zip(pose.position, pose.velocity, strict=True)]
        self._distance_m = self._path.advanced_m(self._distance_m, position)
        here = self._path.at(self._distance_m)
        self.cross_track_m = math.dist(here.position_m, position)
        self._planned_s += dt_s
        if self._planned_s >= REPLAN_S:
            self._planned_s = 0.0
            self._plan_sample, self._plan_mps = self._plan()

        late_s = self._controller.plant.plane.late_s
        before = self._speed_mps
        along = sum(v * t for v, t in zip(pose.velocity, here.tangent, strict=True))
        self._speed_mps = speed = min(
            before + self._config.acceleration_mps2 * dt_s,
            self._speed_at(self._distance_m + before * late_s),
            max(along, 0.0) + SPEED_LEAD_MPS,
        )
        ahead = self._path.at(self._distance_m + speed * late_s)
        gain = (speed - before) / dt_s if dt_s > 0.0 else 0.0
        gain = max(-self._config.acceleration_mps2, min(self._config.acceleration_mps2, gain))
        turn_soon = self._path.at(self._distance_m + speed * YAW_LOOK_S).yaw_rate_radpm
        level = math.hypot(here.tangent[0], here.tangent[1])
        return Reference(
            position_m=here.position_m,
            velocity_mps=_scaled(here.tangent, speed),
            acceleration_mps2=_sum(
                _scaled(ahead.curvature_1pm, speed * speed), _scaled(ahead.tangent, gain)
            ),
            yaw_rad=here.yaw_rad,
            yaw_rate_radps=speed * here.yaw_rate_radpm,
            yaw_acceleration_radps2=speed * (turn_soon - here.yaw_rate_radpm) / YAW_LOOK_S,
            along=(here.tangent[0] / level, here.tangent[1] / level) if level > 0.1 else (0.0, 0.0),
        )

    def places(self, times_s: Array) -> tuple[Array, Array]:
        """Where it will be at times from now, (N, 3) in m, and how fast, (N, 3) in m/s."""
        distance_m, now_s = self._distance_m, 0.0
        places = np.empty((len(times_s), 3))
        speeds = np.empty((len(times_s), 3))
        speed = self._speed_mps
        for row, time_s in enumerate(times_s.tolist()):
            gain = self._config.acceleration_mps2 * (time_s - now_s)
            speed = min(speed + gain, self._speed_at(distance_m))
            distance_m += speed * (time_s - now_s)
            now_s = time_s
            there = self._path.at(distance_m)
            places[row] = there.position_m
            speeds[row] = _scaled(there.tangent, speed)
        return places, speeds

    def _speed_at(self, distance_m: float) -> float:
        index = int(distance_m / self._path.spacing_m) - self._plan_sample
        return float(self._plan_mps[max(0, min(index, len(self._plan_mps) - 1))])

    def _plan(self) -> tuple[int, Array]:
        """The first sample planned, and the speeds in m/s from there on."""
        config, path, plant = self._config, self._path, self._controller.plant
        first = int(self._distance_m / path.spacing_m)
        last = len(path.points_m) - 1
        samples = np.arange(first, first + round(PLAN_M / path.spacing_m) + 1)
        samples = samples % last if path.closed else samples[samples <= last]
        tangents, curvatures = path.tangents[samples], path.curvatures_1pm[samples]
        share = config.max_speed_fraction
        rise = np.maximum(np.abs(tangents[:, 2]), 1e-6)
        curvature = np.maximum(np.linalg.norm(curvatures, axis=1), 1e-6)
        turning = np.maximum(np.abs(path.yaw_rates_radpm[samples]), 1e-6)
        limits = [
            self._manageable_mps(tangents[:, :2], curvatures[:, :2]),
            share * min(plant.up.top_speed, plant.down.top_speed) / rise,
            share * plant.yaw.top_speed / turning,
            np.sqrt(config.lateral_acceleration_mps2 / curvature),
        ]
        speeds: Array = np.maximum(np.min(limits, axis=0), MIN_SPEED_MPS)
        if not path.closed and samples[-1] == last:
            speeds[-1] = MIN_SPEED_MPS
        # v squared falls by 2 a a metre at most.
        fall = 2.0 * config.acceleration_mps2 * path.spacing_m * np.arange(len(speeds))
        lowest = np.minimum.accumulate((speeds**2 + fall)[::-1])[::-1]
        return first, np.asarray(np.sqrt(lowest - fall), dtype=np.float64)

    def _manageable_mps(self, tangents: Array, curvatures_1pm: Array) -> Array:
        """The highest speed at each sample, (N,), for which the level sticks suffice in the wind.

        Args:
            tangents: level parts, (N, 2).
            curvatures_1pm: the same of the curvature vectors.
        """
        plane = self._controller.plant.plane
        wind = np.asarray(self._controller.disturbance.plane_mps2)
        speeds = np.linspace(MIN_SPEED_MPS, max(self.suggestion.speed, MIN_SPEED_MPS), SPEED_STEPS)
        # The sticks that each speed needs at each sample, as the speed that they ask for.
        column = speeds[:, None, None]
        needed = column * tangents + (column**2 * curvatures_1pm - wind) / plane.rate_ps
        needed_mps = np.linalg.norm(needed, axis=2)
        limit_mps = self._config.max_speed_fraction * plane.top_speed
        # The fastest that can be kept along with all slower ones; the slowest is never refused.
        last = np.maximum(np.cumprod(needed_mps <= limit_mps, axis=0).sum(axis=0), 1) - 1
        after, samples = np.minimum(last + 1, SPEED_STEPS - 1), np.arange(len(last))
        rise = np.maximum(needed_mps[after, samples] - needed_mps[last, samples], 1e-6)
        share = np.clip((limit_mps - needed_mps[last, samples]) / rise, 0.0, 1.0)
        fastest: Array = speeds[last] + share * (speeds[after] - speeds[last])
        return fastest


def _scaled(vector: tuple[float, float, float], by: float) -> tuple[float, float, float]:
    return vector[0] * by, vector[1] * by, vector[2] * by


def _sum(
    one: tuple[float, float, float], other: tuple[float, float, float]
) -> tuple[float, float, float]:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]
