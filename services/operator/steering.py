"""Steering by hand: pure pursuit of the lane with forward and turn, as with a front camera. Pure.

Pure pursuit: the circle through the vehicle, tangent to its heading, that meets a point of the lane
at distance L and `left` beside the heading has curvature 2 left / L^2.
"""

import math

from common.frames import Array, world_to_heading
from common.sticks import FullStick
from services.operator.eyes import Sight
from services.operator.lane import Place
from services.operator.sources import Deflection

LOOK_AHEAD_M = 2.4
"""Just beyond the nearest ground in the picture, 2.1 m ahead at 1 m of height."""
LEFT_GAIN_PER_S = 0.3
LEFT_LIMIT_MPS = 0.2
TURN_LIMIT_RADPS = 0.7
ROOM_M = 0.6
"""Further from the midline than this a person slows down."""

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


def pursue(
    sight: Sight, place: Place, target_m: Array, speed_mps: float, full: FullStick
) -> Deflection:
    """Forward, a little sideways, and turn toward a point (2,) of the lane ahead."""
    dx, dy = (float(each) for each in target_m - sight.position_m[:2])
    ahead_m, left_m = world_to_heading(dx, dy, sight.yaw_rad)
    distance_m = max(math.hypot(ahead_m, left_m), 0.3)
    forward_mps = speed_mps * max(0.2, ahead_m / distance_m)
    if abs(place.left_m) > ROOM_M:
        forward_mps *= 0.6
    if ahead_m > 0.0:
        turn_radps = forward_mps * 2.0 * left_m / (distance_m * distance_m)
    else:
        turn_radps = math.copysign(TURN_LIMIT_RADPS, left_m)
    left_mps = -LEFT_GAIN_PER_S * place.left_m
    return Deflection(
        vx=_limited(forward_mps / full.forward_mps, 1.0),
        vy=_limited(left_mps, LEFT_LIMIT_MPS) / full.left_mps,
        wz=_limited(turn_radps, TURN_LIMIT_RADPS) / full.yaw_radps,
    )


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
