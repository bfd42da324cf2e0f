"""What a stick means: its dead band and what full stick is on each plant."""

from dataclasses import dataclass

from common.messages import Command, Stick

DEAD_BAND = 0.05
"""Deflections up to this are neutral (rpg_quadrotor_control's manual_flight_assistant)."""


@dataclass(frozen=True)
class FullStick:
    """The steady speeds that a stick of 1 commands."""

    forward_mps: float
    left_mps: float
    up_mps: float
    yaw_radps: float


FULL_STICK: dict[str, FullStick] = {
    # tum_simulator a020d89: velocity_x, velocity_y 1 m/s, velocity_z 0.5 m/s, yaw 1 rad/s.
    "tum": FullStick(1.0, 1.0, 0.5, 1.0),
    # tum_ardrone 6bcfb34, c1..c8: tilt saturates at 12 deg, which gives c2 sin(12 deg) = 3.6 m/s;
    # climb c8 = 0.6 m/s; yaw c6 = 90 deg/s.
    "ardrone": FullStick(3.66, 3.66, 0.6, 1.571),
}


def is_neutral(stick: Stick | Command, dead_band: float = DEAD_BAND) -> bool:
    """Whether no axis is beyond the dead band."""
    return max(abs(stick.vx), abs(stick.vy), abs(stick.vz), abs(stick.wz)) <= dead_band
