"""Keeps a hovering vehicle at its place."""

import math

from common.frames import yaw_of
from common.messages import Pose
from services.autopilot.control import Controller, Reference, Sticks

STOPPED_MPS = 0.2
"""Slower than this it has stopped: here is the place to keep."""
LEASH_M = 1.0
"""Pushed farther than this, the place comes along: nothing is pulled back from afar."""


class Hold:
    """First stops the vehicle, then keeps it where it stopped.

    Args:
        pose: where it is; it keeps this heading.
        controller: of the vehicle.
    """

    def __init__(self, pose: Pose, controller: Controller) -> None:
        self._controller = controller
        self._yaw_rad = yaw_of(pose.orientation)
        self._place_m: tuple[float, float, float] | None = None

    def sticks(self, pose: Pose, age_s: float, dt_s: float) -> Sticks:
        """The sticks for now; arguments as of the controller's."""
        if self._place_m is None and math.hypot(*pose.velocity) < STOPPED_MPS:
            self._place_m = pose.position
        if self._place_m is None or math.dist(self._place_m, pose.position) > LEASH_M:
            reference = Reference(pose.position, self._yaw_rad)
            self._place_m = None
        else:
            reference = Reference(self._place_m, self._yaw_rad)
        return self._controller.sticks(pose, age_s, reference, dt_s)
