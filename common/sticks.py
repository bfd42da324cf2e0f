"""What a stick means: its dead band and what full stick is on each plant."""

import math
from dataclasses import dataclass

from common.messages import Command, Stick, VehicleStatus

DEAD_BAND = 0.05
"""Deflections up to this are neutral (rpg_quadrotor_control's manual_flight_assistant)."""
END_BUTTON = "end"
"""A stick's button for the end of a primitive, where hands have no face buttons."""


@dataclass(frozen=True)
class FullStick:
    """The steady speeds that a stick of 1 commands.

    Attributes:
        forward_mps: of `vx`, backward of -1.
        left_mps: of `vy`, right of -1.
        up_mps: of `vz`.
        yaw_radps: of `wz`, counter-clockwise.
        down_mps: of `vz` = -1.
        linear_to: forward and left grow up to this deflection; beyond it they are full.
    """

    forward_mps: float
    left_mps: float
    up_mps: float
    yaw_radps: float
    down_mps: float
    linear_to: float = 1.0

    @property
    def moves_every_way(self) -> bool:
        """Whether each stick moves the vehicle, as drones do and cars do not."""
        speeds = (self.forward_mps, self.left_mps, self.up_mps, self.down_mps, self.yaw_radps)
        return min(speeds) > 0.0


_TILTED_MPS = 9.81 * math.tan(math.radians(12.0)) / 0.58

FULL_STICK: dict[str, FullStick] = {
    # tum_simulator a020d89: velocity_x, velocity_y 1 m/s, velocity_z 0.5 m/s, yaw 1 rad/s.
    "tum": FullStick(1.0, 1.0, 0.5, 1.0, 0.5),
    # tum_ardrone 6bcfb34, c1..c8: tilt is 24 deg times the stick up to 0.5, that is 12 deg at most;
    # against a drag of 0.58 / s that gives g tan(12 deg) / 0.58. Climb c8 is 0.6 m/s, twice that
    # downwards; yaw c6 is 90 deg/s.
    "ardrone": FullStick(_TILTED_MPS, _TILTED_MPS, 0.6, math.pi / 2.0, 1.2, linear_to=0.5),
}


def full_stick_of(status: VehicleStatus) -> FullStick:
    """What full stick is on a vehicle; one of which that is not known passes for a `tum`."""
    if status.full_stick is None:
        return FULL_STICK.get(status.plant, FULL_STICK["tum"])
    forward_mps, left_mps, up_mps, down_mps, yaw_radps = status.full_stick
    return FullStick(forward_mps, left_mps, up_mps, yaw_radps, down_mps)


def is_neutral(stick: Stick | Command, dead_band: float = DEAD_BAND) -> bool:
    """Whether no axis is beyond the dead band."""
    return max(abs(stick.vx), abs(stick.vy), abs(stick.vz), abs(stick.wz)) <= dead_band
