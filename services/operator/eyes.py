"""What a simulated person sees: through the front camera, late, and not quite right. Pure.

Nothing outside the picture reaches the rest of the operator: route points count as seen only where
the front camera shows them, and everything passes through the same delay.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.camera import FRONT, Lens, project, to_optical
from common.clock import nanoseconds, seconds
from common.frames import Array, rotation_of, yaw_of
from common.messages import Pose
from services.operator.route import Route

LENS = Lens.of_view(640, 360, math.radians(81.0))
SIGHT_M = 12.0
"""Beyond this the ground is too flat to the eye to say where the lane is."""
BEHIND_M = 3.0
KEPT_S = 2.0

# Of slowly wandering errors (time constant WANDER_S): a person judges places at a few metres to
# about 5 % in depth and half a degree in direction, and his own height and place to a hand's width.
WANDER_S = 1.5
PLACE_SIGMA_M = 0.05
HEIGHT_SIGMA_M = 0.03
YAW_SIGMA_RAD = math.radians(0.5)
DEPTH_SIGMA = 0.05
BEARING_SIGMA_RAD = math.radians(0.5)
SPEED_SIGMA = 0.05


@dataclass(frozen=True, eq=False)
class Sight:
    """One look at the picture.

    Attributes:
        position_m: where the vehicle seems to be, world frame.
        yaw_rad: where it seems to head.
        velocity_mps: (2,) how it seems to move along the ground, world frame.
        indices: (K,) of the route's points that are in view.
        points_m: (K, 2) where those seem to be, world frame as the person has it.
    """

    position_m: Array
    yaw_rad: float
    velocity_mps: Array
    indices: NDArray[np.intp]
    points_m: Array

    @property
    def speed_mps(self) -> float:
        """How fast the vehicle seems to move along the ground."""
        return float(np.linalg.norm(self.velocity_mps))


class Eyes:
    """Turns true poses into what is seen of them.

    Args:
        route: whose lane is looked for.
        delay_s: of everything seen.
        rng: of the errors.
    """

    def __init__(self, route: Route, delay_s: float, rng: np.random.Generator) -> None:
        self._route = route
        self._delay_ns = nanoseconds(delay_s)
        self._rng = rng
        self._poses: deque[tuple[int, Pose]] = deque()
        self._errors = rng.normal(size=7)
        self._errors_ns: int | None = None
        seen_at_m = route.points_m.copy()
        if route.is_on_ground:
            seen_at_m[:, 2] = 0.0
        self._marks_m = seen_at_m

    def truth(self, pose: Pose, arrival_ns: int) -> None:
        """Take a true pose."""
        self._poses.append((arrival_ns, pose))
        while arrival_ns - self._poses[0][0] > nanoseconds(KEPT_S):
            self._poses.popleft()

    def look(self, now_ns: int, along_m: float) -> Sight | None:
        """What the person sees now; None while there is no fresh picture.

        Args:
            now_ns: monotonic time.
            along_m: where on the route the person takes the vehicle to be; the lane is followed
                with the eyes from there, not taken from another part of the circuit.
        """
        shown = None
        for arrival_ns, pose in reversed(self._poses):
            if now_ns - arrival_ns >= self._delay_ns:
                shown = (arrival_ns, pose)
                break
        if shown is None or now_ns - shown[0] > self._delay_ns + nanoseconds(0.5):
            return None
        pose = shown[1]
        x_error, y_error, z_error, yaw_error, depth_error, bearing_error, speed_error = (
            self._wander(now_ns)
        )
        position_m = np.asarray(pose.position)
        yaw_rad = yaw_of(pose.orientation)
        seen_position_m = position_m + np.array(
            [PLACE_SIGMA_M * x_error, PLACE_SIGMA_M * y_error, HEIGHT_SIGMA_M * z_error]
        )
        seen_yaw_rad = yaw_rad + YAW_SIGMA_RAD * yaw_error
        indices = self.in_view(pose, along_m)
        offsets_m = self._marks_m[indices, :2] - position_m[:2]
        turn_rad = YAW_SIGMA_RAD * yaw_error + BEARING_SIGMA_RAD * bearing_error
        cos, sin = math.cos(turn_rad), math.sin(turn_rad)
        scale = 1.0 + DEPTH_SIGMA * float(np.clip(depth_error, -3.0, 3.0))
        turned_m = scale * offsets_m @ np.array([[cos, sin], [-sin, cos]])
        return Sight(
            position_m=seen_position_m,
            yaw_rad=seen_yaw_rad,
            velocity_mps=np.asarray(pose.velocity[:2]) * (1.0 + SPEED_SIGMA * speed_error),
            indices=indices,
            points_m=seen_position_m[:2] + turned_m,
        )

    def in_view(self, pose: Pose, along_m: float) -> NDArray[np.intp]:
        """Indices of the route's points near `along_m` that the front picture shows."""
        route = self._route
        begin = math.floor((along_m - BEHIND_M) / route.step_m)
        end = math.ceil((along_m + SIGHT_M + BEHIND_M) / route.step_m)
        count = len(route.points_m)
        if route.is_closed:
            near = np.arange(begin, min(end, begin + count)) % count
        else:
            near = np.arange(max(begin, 0), min(end, count), dtype=np.intp)
        optical_m = to_optical(
            self._marks_m[near], np.asarray(pose.position), rotation_of(pose.orientation), FRONT
        )
        pixels, in_front = project(optical_m, LENS)
        inside = (
            (pixels[:, 0] >= 0.0)
            & (pixels[:, 0] < LENS.width)
            & (pixels[:, 1] >= 0.0)
            & (pixels[:, 1] < LENS.height)
        )
        in_reach = np.linalg.norm(optical_m, axis=1) <= SIGHT_M
        visible = near[in_front & inside & in_reach]
        return np.asarray(visible, dtype=np.intp)

    def _wander(self, now_ns: int) -> list[float]:
        """The errors now, of unit variance each, as Ornstein-Uhlenbeck processes."""
        if self._errors_ns is not None:
            keep = math.exp(-seconds(now_ns - self._errors_ns) / WANDER_S)
            fresh = self._rng.normal(size=self._errors.size)
            self._errors = keep * self._errors + math.sqrt(1.0 - keep * keep) * fresh
        self._errors_ns = now_ns
        return [float(error) for error in self._errors]
