"""Steering by hand: pure pursuit of the lane with forward and turn, as with a front camera. Pure.

Pure pursuit: the circle through the vehicle, tangent to its heading, that meets a point of the lane
at distance L and `left` beside the heading has curvature 2 left / L^2.
"""

import math
from dataclasses import replace

from common.frames import Array, world_to_heading
from common.sticks import FullStick
from services.operator.eyes import Sight
from services.operator.lane import Place
from services.operator.sources import Deflection

LOOK_AHEAD_M = 2.4
"""Just beyond the nearest ground in the picture, 2.1 m ahead at 1 m of height."""
TURN_LIMIT_RADPS = 0.7
ROOM_M = 0.5
"""Further from the midline than this a person slows down and moves sideways as well."""
SLOWED = 0.6
LEFT_MPS = 0.2

HEIGHT_BEGIN_M = 0.15
HEIGHT_END_M = 0.05
HEIGHT_GAIN_PER_S = 0.8


class Climb:
    """Keeps a height with the vertical stick: in single corrections, not all the time."""

    def __init__(self) -> None:
        self._correcting = False

    def stick(self, error_m: float, limit: float, full: FullStick) -> float:
        """The vertical stick for a height that is `error_m` too low."""
        threshold_m = HEIGHT_END_M if self._correcting else HEIGHT_BEGIN_M
        self._correcting = abs(error_m) > threshold_m
        if not self._correcting:
            return 0.0
        wanted = HEIGHT_GAIN_PER_S * error_m / full.up_mps
        # Less than this the dead band swallows.
        return math.copysign(min(max(abs(wanted), 0.15), limit), error_m)


def foreseen(sight: Sight, turned_rad: float, delay_s: float) -> Sight:
    """The look of `delay_s` ago as it must be now, by what his hands have done since."""
    position_m = sight.position_m.copy()
    position_m[:2] += delay_s * sight.velocity_mps
    return replace(sight, position_m=position_m, yaw_rad=sight.yaw_rad + turned_rad)


def pursue(
    sight: Sight, place: Place, target_m: Array, speed_mps: float, full: FullStick
) -> Deflection:
    """Forward and turn, sideways too where it is narrow, toward a point (2,) of the lane ahead."""
    dx, dy = (float(each) for each in target_m - sight.position_m[:2])
    ahead_m, left_m = world_to_heading(dx, dy, sight.yaw_rad)
    distance_m = max(math.hypot(ahead_m, left_m), 0.3)
    forward_mps = speed_mps * max(0.2, ahead_m / distance_m)
    left_mps = 0.0
    if abs(place.left_m) > ROOM_M:
        forward_mps *= SLOWED
        left_mps = -math.copysign(LEFT_MPS, place.left_m)
    if ahead_m > 0.0:
        turn_radps = forward_mps * 2.0 * left_m / (distance_m * distance_m)
    else:
        turn_radps = math.copysign(TURN_LIMIT_RADPS, left_m)
    return Deflection(
        vx=_limited(forward_mps / full.forward_mps, 1.0),
        vy=left_mps / full.left_mps,
        wz=_limited(turn_radps, TURN_LIMIT_RADPS) / full.yaw_radps,
    )


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
