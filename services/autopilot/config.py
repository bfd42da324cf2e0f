"""What can be set about the autopilot."""

import dataclasses
from dataclasses import dataclass

from common.fence import MAX_HEIGHT_M, RADIUS_M
from common.sticks import DEAD_BAND
from common.topics import TOPICS

SHORTEST_PERIOD_S = 0.001
LONGEST_PERIOD_S = 0.1
"""Longer than this, a stick's loss would be seen too late."""


@dataclass(frozen=True)
class Config:
    """Limits in s, m, m/s, m/s2, rad/s. Gains are in the units of their axis.

    Raises:
        ValueError: if a value cannot be used; the text names the field.
    """

    step_period_s: float = 0.02
    """Period of the control step, s."""
    status_period_s: float = 0.05
    """Period of `autopilot` while nothing changes, s."""
    dead_band: float = DEAD_BAND
    """Deflections up to this are neutral, fraction of full stick."""

    stick_loss_s: float = TOPICS["stick"].max_age_s
    """Sticks older than this are neutral, s."""
    pose_loss_s: float = TOPICS["pose"].max_age_s
    """Poses older than this are not flown by: the vehicle holds with neutral sticks, s."""
    hold_s: float = 0.5
    """An engaged path is given up when the last pose is older than this, s."""
    land_after_s: float = 5.0
    """The vehicle lands when a loss has lasted this long, s."""
    steady_s: float = 1.0
    """Sticks and poses that came back must have been steady this long before a place is kept, s."""
    stuck_s: float = 20.0
    """Deflected sticks that have not moved at all for so long are a broken pad, s. A hand trembles;
    only a key, or a stick at its stop, rests like that."""
    battery_low: float = 0.2
    """With this charge or less no path and no take-off is begun, 0 to 1."""
    battery_empty: float = 0.05
    """With this charge or less the vehicle lands as soon as the sticks rest, 0 to 1."""
    slew_ps: float = 5.0
    """How fast the autopilot's own sticks move at most, fractions of full stick a second."""
    takeoff_timeout_s: float = 3.0
    """`takeoff` is sent until the vehicle obeys, at most this long, s."""

    suggestion_age_s: float = TOPICS["suggestion"].max_age_s
    """A suggestion can be accepted this long after its arrival, s."""
    start_distance_m: float = 1.0
    """A path can be accepted when the vehicle is at most this far from it, m."""
    leave_path_m: float = 2.0
    """A path is given up when the vehicle is farther than this from it, m."""
    min_height_m: float = 0.2
    """Paths and engaged flight stay above this height, m."""
    max_height_m: float = MAX_HEIGHT_M
    """Paths and engaged flight stay below this height, m."""
    fence_radius_m: float = RADIUS_M
    """Paths and engaged flight stay this near to the world's origin, m."""

    max_speed_fraction: float = 0.9
    """Highest path speed, share of what the sticks can do; the rest is left for corrections."""
    acceleration_mps2: float = 0.6
    """Speed-up and slow-down along the path, m/s2."""
    lateral_acceleration_mps2: float = 1.0
    """Limits the speed in curves, m/s2."""
    plane_p: float = 3.0
    """Plane PID, m/s2 per m."""
    plane_i: float = 0.3
    """Plane PID, m/s2 per m s. The wind is not its work: disturbance.py knows it."""
    plane_d: float = 3.2
    """Plane PID, m/s2 per m/s."""
    vertical_p: float = 3.0
    """Vertical PID, m/s2 per m."""
    vertical_i: float = 0.3
    """Vertical PID, m/s2 per m s."""
    vertical_d: float = 3.0
    """Vertical PID, m/s2 per m/s."""
    yaw_p: float = 2.4
    """Yaw PID, rad/s2 per rad."""
    yaw_i: float = 0.2
    """Yaw PID, rad/s2 per rad s."""
    yaw_d: float = 2.2
    """Yaw PID, rad/s2 per rad/s."""

    def __post_init__(self) -> None:
        gains = {f"{axis}_{term}" for axis in ("plane", "vertical", "yaw") for term in "pid"}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in gains | {"min_height_m", "battery_low", "battery_empty"}:
                if value < 0.0:
                    raise ValueError(f"{field.name} must not be negative, is {value}")
            elif value <= 0.0:
                raise ValueError(f"{field.name} must be positive, is {value}")
        for name in ("step_period_s", "status_period_s"):
            if not SHORTEST_PERIOD_S <= getattr(self, name) <= LONGEST_PERIOD_S:
                raise ValueError(
                    f"{name} must be {SHORTEST_PERIOD_S} to {LONGEST_PERIOD_S} s,"
                    f" is {getattr(self, name)}"
                )
        for name in ("dead_band", "max_speed_fraction", "battery_low", "battery_empty"):
            if getattr(self, name) >= 1.0:
                raise ValueError(f"{name} must be below 1, is {getattr(self, name)}")
        if self.max_height_m <= self.min_height_m:
            raise ValueError("max_height_m must be above min_height_m")
        if self.hold_s < self.pose_loss_s:
            raise ValueError("hold_s must not be below pose_loss_s")
