"""From where the vehicle should be to the sticks.

Feed-forward of the motion and one PID each for plane, height and yaw, through the plant's model
turned round.
"""

import math
from dataclasses import dataclass

from common.frames import world_to_heading, wrap_angle, yaw_of
from common.messages import Command, Pose
from services.autopilot.config import Config
from services.autopilot.disturbance import Disturbance
from services.autopilot.pid import Gains, Pid, limit_norm
from services.autopilot.plants import PLANTS, Plant

PLANE_LIMIT_MPS2 = 2.0
UP_LIMIT_MPS2 = 1.0
YAW_LIMIT_RADPS2 = 3.0
"""The most that a PID asks for: a vehicle far off comes back at a moderate speed."""


@dataclass(frozen=True)
class Sticks:
    """Fractions of full stick: forward, left, up, counter-clockwise."""

    vx: float
    vy: float
    vz: float
    wz: float


NEUTRAL = Sticks(0.0, 0.0, 0.0, 0.0)

Vector3 = tuple[float, float, float]


@dataclass(frozen=True)
class Reference:
    """Where the vehicle should be now, and how it should move; world frame.

    Attributes:
        position_m: the place.
        velocity_mps: the velocity there.
        acceleration_mps2: that of the motion, as much ahead of now as the plant is late.
        yaw_rad: the heading.
        yaw_rate_radps: its change.
        yaw_acceleration_radps2: the change of that.
        along: the level direction (unit, or zero) in which the vehicle may lag when the sticks
            cannot do everything: to be on the path goes before to be fast on it.
    """

    position_m: Vector3
    yaw_rad: float
    velocity_mps: Vector3 = (0.0, 0.0, 0.0)
    acceleration_mps2: Vector3 = (0.0, 0.0, 0.0)
    yaw_rate_radps: float = 0.0
    yaw_acceleration_radps2: float = 0.0
    along: tuple[float, float] = (0.0, 0.0)


class Controller:
    """Keeps the vehicle at a moving reference. Its memory outlives a change of references.

    Args:
        plant: its name, of `PLANTS` unless there is a model.
        config: gains.
        model: how it follows its sticks.
    """

    def __init__(self, plant: str, config: Config, model: Plant | None = None) -> None:
        self.plant_name = plant
        self.plant = model or PLANTS[plant]
        self.disturbance = Disturbance(self.plant)
        self._plane = Pid(
            Gains(config.plane_p, config.plane_i, config.plane_d, PLANE_LIMIT_MPS2), 2
        )
        self._up = Pid(
            Gains(config.vertical_p, config.vertical_i, config.vertical_d, UP_LIMIT_MPS2), 1
        )
        self._yaw = Pid(Gains(config.yaw_p, config.yaw_i, config.yaw_d, YAW_LIMIT_RADPS2), 1)
        self._plane_saturated = self._up_saturated = self._yaw_saturated = False

    def observe(self, pose: Pose, command: Command, dt_s: float) -> None:
        """See what came of the last command, whoever gave it."""
        self.disturbance.observe(pose, command, dt_s)

    def relax(self) -> None:
        """Forget the errors of the last flight; the wind stays known."""
        for pid in (self._plane, self._up, self._yaw):
            pid.reset()

    def sticks(self, pose: Pose, age_s: float, reference: Reference, dt_s: float) -> Sticks:
        """The sticks for now.

        Args:
            pose: the newest pose.
            age_s: how long ago it arrived; it is carried on by its speeds for so long.
            reference: where the vehicle should be.
            dt_s: time since the last call.
        """
        position = [p + v * age_s for p, v in zip(pose.position, pose.velocity, strict=True)]
        turn_radps = pose.angular_velocity[2]
        yaw_rad = yaw_of(pose.orientation) + turn_radps * age_s
        error = [r - p for r, p in zip(reference.position_m, position, strict=True)]
        rate = [r - v for r, v in zip(reference.velocity_mps, pose.velocity, strict=True)]
        vx, vy = self._level(pose, reference, error[:2], rate[:2], yaw_rad, dt_s)
        vz = self._upward(pose, reference, error[2], rate[2], dt_s)

        response = self.plant.yaw
        (pull,) = self._yaw.correction(
            [wrap_angle(reference.yaw_rad - yaw_rad)],
            [reference.yaw_rate_radps - turn_radps],
            dt_s,
            self._yaw_saturated,
        )
        wanted = reference.yaw_acceleration_radps2 + pull - self.disturbance.yaw_radps2
        wz = (turn_radps + wanted / response.rate_ps) / response.speed
        self._yaw_saturated = abs(wz) > 1.0
        # Unlike max and min, this leaves what is no number to the guard.
        (wz,) = limit_norm([wz], 1.0)
        return Sticks(vx, vy, vz, wz)

    def _level(
        self,
        pose: Pose,
        reference: Reference,
        error: list[float],
        rate: list[float],
        yaw_rad: float,
        dt_s: float,
    ) -> tuple[float, float]:
        response = self.plant.plane
        pull = self._plane.correction(error, rate, dt_s, self._plane_saturated)
        wanted = []
        for axis in (0, 1):
            forward = reference.acceleration_mps2[axis]
            push = forward + pull[axis] - self.disturbance.plane_mps2[axis]
            speed = pose.velocity[axis] + response.late_s * forward
            wanted.append(speed + push / response.rate_ps)
        allowed = within(wanted, reference.along, response.top_speed)
        self._plane_saturated = allowed != wanted
        forward_mps, left_mps = world_to_heading(allowed[0], allowed[1], yaw_rad)
        return forward_mps / response.speed, left_mps / response.speed

    def _upward(
        self, pose: Pose, reference: Reference, error_m: float, rate_mps: float, dt_s: float
    ) -> float:
        (pull,) = self._up.correction([error_m], [rate_mps], dt_s, self._up_saturated)
        push = reference.acceleration_mps2[2] + pull - self.disturbance.up_mps2
        wanted = pose.velocity[2] + push / self.plant.up.rate_ps
        response = self.plant.up if wanted > 0.0 else self.plant.down
        vz = wanted / response.speed
        self._up_saturated = abs(vz) > 1.0
        (vz,) = limit_norm([vz], 1.0)
        return vz


def within(wanted: list[float], along: tuple[float, float], limit: float) -> list[float]:
    """A level vector of at most a length: what lies along a direction gives way first."""
    if math.hypot(*wanted) <= limit:
        return wanted
    if along == (0.0, 0.0):
        return limit_norm(wanted, limit)
    here = wanted[0] * along[0] + wanted[1] * along[1]
    (across,) = limit_norm([wanted[1] * along[0] - wanted[0] * along[1]], limit)
    room = math.sqrt(max(limit * limit - across * across, 0.0))
    here = max(-room, min(room, here))
    return [here * along[0] - across * along[1], here * along[1] + across * along[0]]
