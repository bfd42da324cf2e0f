"""Wind, and whatever else moves the vehicle without its sticks: watched all the time.

An observer: what the plant's model does not explain of the change of speed, averaged over a
second. It looks at the commands that went out, so it cannot wind up in saturation, and it goes on
while the human flies, so that whoever takes over knows the wind already.
"""

import math

from common.frames import heading_to_world, yaw_of
from common.messages import Command, Pose
from services.autopilot.pid import limit_norm
from services.autopilot.plants import Plant

TIME_S = 1.0
"""Of the average."""
MOST = 0.9
"""Share of what the sticks can do that is believed at most."""


class Disturbance:
    """Accelerations east, north, up in m/s2 and about z in rad/s2.

    Args:
        plant: how the vehicle follows its sticks.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._speeds: list[float] | None = None
        self.asked = [0.0] * 4
        """The speeds that the sticks ask for, as late as the plant has them: east, north, up in m/s
        and about z in rad/s."""
        self.plane_mps2 = [0.0, 0.0]
        self.up_mps2 = 0.0
        self.yaw_radps2 = 0.0

    def pause(self) -> None:
        """Poses are missing: keep what is known, and do not take the gap for a gust."""
        self._speeds = None

    def observe(self, pose: Pose, command: Command, dt_s: float) -> None:
        """Take in the newest pose and the command that was being flown for `dt_s`."""
        plant = self._plant
        vx, vy = limit_norm([command.vx, command.vy], plant.plane.limit)
        east, north = heading_to_world(
            vx * plant.plane.speed, vy * plant.plane.speed, yaw_of(pose.orientation)
        )
        upward = plant.up if command.vz > 0.0 else plant.down
        asked = [east, north, command.vz * upward.speed, command.wz * plant.yaw.speed]
        responses = (plant.plane, plant.plane, upward, plant.yaw)
        speeds = [*pose.velocity, pose.angular_velocity[2]]
        for axis, (value, response) in enumerate(zip(asked, responses, strict=True)):
            share = 1.0 if response.late_s == 0.0 else min(1.0, dt_s / response.late_s)
            self.asked[axis] += share * (value - self.asked[axis])
        if self._speeds is not None:
            values = [*self.plane_mps2, self.up_mps2, self.yaw_radps2]
            share = 1.0 - math.exp(-dt_s / TIME_S)
            for axis, response in enumerate(responses):
                # The change of speed enters whole, the rest averaged: no speed is differentiated.
                change = (speeds[axis] - self._speeds[axis]) / TIME_S
                explained = response.rate_ps * (self.asked[axis] - self._speeds[axis])
                values[axis] += change - share * (explained + values[axis])
            self._set(values)
        self._speeds = speeds

    def _set(self, values: list[float]) -> None:
        plant = self._plant
        most = MOST * plant.plane.rate_ps * plant.plane.top_speed
        self.plane_mps2 = limit_norm(values[:2], most)
        (self.up_mps2,) = limit_norm(values[2:3], MOST * plant.up.rate_ps * plant.up.top_speed)
        (self.yaw_radps2,) = limit_norm(values[3:], MOST * plant.yaw.rate_ps * plant.yaw.top_speed)
