"""Flies a path: feed-forward of its speed and turn, one PID each for plane, height and yaw."""

import math
from dataclasses import dataclass

import numpy as np

from common.frames import Array, world_to_heading, wrap_angle, yaw_of
from common.messages import Pose, Suggestion
from common.sticks import FULL_STICK
from services.autopilot.config import Config
from services.autopilot.path import BadPathError, Path
from services.autopilot.pid import Gains, Pid, limit_norm
from services.autopilot.plants import LAGS

FINISH_M = 0.1
"""An open path is finished this near to its end; the vehicle coasts about as far."""
MIN_SPEED_MPS = 0.15
"""Slowest path speed: the end of a path is reached, not approached for ever."""
PLANE_LIMIT_MPS = 0.5
"""Highest speed at which the plane PID moves the vehicle back to the path."""


@dataclass(frozen=True)
class Sticks:
    """Fractions of full stick: forward, left, up, counter-clockwise."""

    vx: float
    vy: float
    vz: float
    wz: float


class Follower:
    """The flight along one accepted suggestion.

    Args:
        suggestion: what was accepted.
        pose: where the vehicle is; the flight starts at the path's point nearest to it.
        plant: a key of `FULL_STICK`.
        config: limits and gains.

    Raises:
        BadPathError: if the path cannot be flown from here: too short, too low, too high, too far.
    """

    def __init__(self, suggestion: Suggestion, pose: Pose, plant: str, config: Config) -> None:
        self.suggestion = suggestion
        self._config = config
        self._full = FULL_STICK[plant]
        self._lags = LAGS[plant]
        self._path = Path(suggestion.path, suggestion.closed)
        heights = self._path.points_m[:, 2]
        if heights.min() < config.min_height_m or heights.max() > config.max_height_m:
            raise BadPathError("geofence")
        self._start_m = self._path.nearest_start_m(pose.position, config.start_distance_m)
        self._distance_m = self._start_m
        self.cross_track_m = math.dist(self._path.at(self._distance_m).position_m, pose.position)
        if self.cross_track_m > config.start_distance_m:
            raise BadPathError("too_far")
        tangent = self._path.at(self._distance_m).tangent
        along = sum(v * t for v, t in zip(pose.velocity, tangent, strict=True))
        self._speed_mps = min(max(along, MIN_SPEED_MPS), suggestion.speed)
        self._profile = self._speed_profile()
        self._plane = Pid(Gains(config.plane_p, config.plane_i, config.plane_d, PLANE_LIMIT_MPS), 2)
        up = self._full.up_mps
        self._up = Pid(Gains(config.vertical_p, config.vertical_i, config.vertical_d, up), 1)
        turn = self._full.yaw_radps
        self._yaw = Pid(Gains(config.yaw_p, config.yaw_i, config.yaw_d, turn), 1)
        self._plane_saturated = self._up_saturated = self._yaw_saturated = False

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
        position = [p + v * age_s for p, v in zip(pose.position, pose.velocity, strict=True)]
        yaw_rate_radps = pose.angular_velocity[2]
        yaw_rad = yaw_of(pose.orientation) + yaw_rate_radps * age_s
        self._distance_m = self._path.advanced_m(self._distance_m, position)
        here = self._path.at(self._distance_m)
        error = [h - p for h, p in zip(here.position_m, position, strict=True)]
        self.cross_track_m = math.hypot(*error)

        lags = self._lags
        self._speed_mps = min(
            self._speed_mps + self._config.acceleration_mps2 * dt_s,
            self._speed_at(self._distance_m + self._speed_mps * lags.plane_s),
        )
        speed = self._speed_mps
        # A speed that lags by T is right now if it is commanded T early.
        plane_ahead = self._path.at(self._distance_m + speed * lags.plane_s)
        up_ahead = self._path.at(self._distance_m + speed * lags.vertical_s)
        yaw_ahead = self._path.at(self._distance_m + speed * lags.yaw_s)
        rate = [speed * t - v for t, v in zip(here.tangent, pose.velocity, strict=True)]

        east, north = self._plane.correction(error[:2], rate[:2], dt_s, self._plane_saturated)
        (up,) = self._up.correction(error[2:], rate[2:], dt_s, self._up_saturated)
        turn_here = speed * here.yaw_rate_radpm
        (turn,) = self._yaw.correction(
            [wrap_angle(here.yaw_rad - yaw_rad)],
            [turn_here - yaw_rate_radps],
            dt_s,
            self._yaw_saturated,
        )
        forward, left = world_to_heading(
            speed * plane_ahead.tangent[0] + east, speed * plane_ahead.tangent[1] + north, yaw_rad
        )
        wanted = [forward / self._full.forward_mps, left / self._full.left_mps]
        vx, vy = limit_norm(wanted, 1.0)
        self._plane_saturated = [vx, vy] != wanted
        vz = (speed * up_ahead.tangent[2] + up) / self._full.up_mps
        wz = (speed * yaw_ahead.yaw_rate_radpm + turn) / self._full.yaw_radps
        self._up_saturated, self._yaw_saturated = abs(vz) > 1.0, abs(wz) > 1.0
        return Sticks(vx, vy, max(-1.0, min(1.0, vz)), max(-1.0, min(1.0, wz)))

    def _speed_at(self, distance_m: float) -> float:
        within = distance_m % self._path.length_m if self._path.closed else distance_m
        index = min(int(within / self._path.spacing_m), len(self._profile) - 1)
        return float(self._profile[index])

    def _speed_profile(self) -> Array:
        """The speed allowed at each sample by full stick, curves, climbs and the end, in m/s."""
        config, path, full = self._config, self._path, self._full
        share = config.max_speed_fraction
        across = np.maximum(np.hypot(path.tangents[:, 0], path.tangents[:, 1]), 1e-6)
        climb = np.maximum(np.abs(path.tangents[:, 2]), 1e-6)
        curvature = np.maximum(path.curvature_1pm, 1e-6)
        turning = np.maximum(np.abs(path.yaw_rates_radpm), 1e-6)
        limits = [
            np.full(len(across), self.suggestion.speed),
            share * min(full.forward_mps, full.left_mps) / across,
            share * full.up_mps / climb,
            share * full.yaw_radps / turning,
            np.sqrt(config.lateral_acceleration_mps2 / curvature),
        ]
        profile: Array = np.maximum(np.min(limits, axis=0), MIN_SPEED_MPS)
        if not path.closed:
            profile[-1] = MIN_SPEED_MPS
        gain = 2.0 * config.acceleration_mps2 * path.spacing_m
        for _ in range(2 if path.closed else 1):
            for index in range(len(profile) - 2, -1, -1):
                profile[index] = min(profile[index], math.sqrt(profile[index + 1] ** 2 + gain))
            if path.closed:
                profile[-1] = profile[0]
        return profile
