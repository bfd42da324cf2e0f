"""The `tum` plant: a velocity stick, its loops acting by thrust and torques on a rigid body.

The loops are those of tum_simulator a020d89 (references: its simple quadrotor controller); what
they command is divided by inertia and mass, so they act alike on any body.
"""

import math
from dataclasses import dataclass

from common.sticks import FULL_STICK

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

GRAVITY_MPS2 = 9.81
MASS_KG = 0.42
INERTIA_KGM2: Vector3 = (2.237568e-3, 2.985236e-3, 4.80374e-3)
"""About body x, y, z: the figures in public models of the AR.Drone 2.0 (for 0.429 kg)."""
MAX_THRUST_N = 30.0 / 1.477 * MASS_KG
"""tum_simulator allows 30 N on 1.477 kg; this is the same acceleration."""

_VELOCITY_P, _VELOCITY_D, _VELOCITY_LIMIT_MPS = 5.0, 1.0, 2.0
_TILT_P, _TILT_D, _TILT_LIMIT_RAD = 10.0, 5.0, 0.5
_YAW_P, _YAW_LIMIT_RADPS = 2.0, 1.5
_CLIMB_P, _CLIMB_D, _CLIMB_LIMIT_MPS = 5.0, 1.0, 0.5
_TILT_FILTER_S = 0.05
"""The tilt loop differentiates its command. Unfiltered, a step of the stick would ask the rotors
for several N m within one step of physics; with this the peak is 0.1 N m."""


@dataclass(frozen=True, slots=True)
class BodyState:
    """The rigid body's motion.

    Attributes:
        position_m: of the centre of mass, world.
        orientation: body to world, [x, y, z, w].
        rotation: the same as a 3x3 matrix, row by row.
        velocity_mps: world.
        angular_velocity_radps: world.
    """

    position_m: Vector3
    orientation: Quaternion
    rotation: tuple[float, ...]
    velocity_mps: Vector3
    angular_velocity_radps: Vector3

    def to_body(self, vector: Vector3) -> Vector3:
        """A world vector in body coordinates."""
        r, (x, y, z) = self.rotation, vector
        return (
            r[0] * x + r[3] * y + r[6] * z,
            r[1] * x + r[4] * y + r[7] * z,
            r[2] * x + r[5] * y + r[8] * z,
        )

    @property
    def yaw_rad(self) -> float:
        """About z up, counter-clockwise."""
        return math.atan2(self.rotation[3], self.rotation[0])


@dataclass(frozen=True, slots=True)
class Sticks:
    """Fractions of full stick; noise may carry them a little beyond 1."""

    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    wz: float = 0.0


@dataclass(frozen=True, slots=True)
class Loads:
    """What the rotors do: thrust along body z, torque about the body's axes."""

    thrust_n: float
    torque_nm: Vector3


NO_LOADS = Loads(0.0, (0.0, 0.0, 0.0))


class TumPlant:
    """Turns sticks into loads, one step of physics at a time."""

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self.restart()

    def restart(self) -> None:
        """Forget the past, as when the rotors stop."""
        self._velocity_mps: tuple[float, float] | None = None
        self._tilt_rad = (0.0, 0.0)

    def loads(self, sticks: Sticks, state: BodyState, lift: float = 1.0) -> Loads:
        """The loads of the next step; `lift` scales the thrust (take-off, landing)."""
        r = state.rotation
        yaw = state.yaw_rad
        cos, sin = math.cos(yaw), math.sin(yaw)
        pitch = math.asin(max(-1.0, min(1.0, -r[6])))
        roll = math.atan2(r[7], r[8])
        rate_x, rate_y, rate_z = state.to_body(state.angular_velocity_radps)

        full = FULL_STICK["tum"]
        vx_w, vy_w, vz = state.velocity_mps
        vx, vy = cos * vx_w + sin * vy_w, cos * vy_w - sin * vx_w
        last_x, last_y = self._velocity_mps or (vx_w, vy_w)
        self._velocity_mps = (vx_w, vy_w)
        dx, dy = (vx_w - last_x) / self._step_s, (vy_w - last_y) / self._step_s
        ax, ay = cos * dx + sin * dy, cos * dy - sin * dx

        goal_x = _clip(sticks.vx * full.forward_mps, _VELOCITY_LIMIT_MPS)
        goal_y = _clip(sticks.vy * full.left_mps, _VELOCITY_LIMIT_MPS)
        want_pitch = (_VELOCITY_P * (goal_x - vx) - _VELOCITY_D * ax) / GRAVITY_MPS2
        want_roll = -(_VELOCITY_P * (goal_y - vy) - _VELOCITY_D * ay) / GRAVITY_MPS2
        roll_was, pitch_was = self._tilt_rad
        share = self._step_s / (self._step_s + _TILT_FILTER_S)
        roll_goal = roll_was + share * (_clip(want_roll, _TILT_LIMIT_RAD) - roll_was)
        pitch_goal = pitch_was + share * (_clip(want_pitch, _TILT_LIMIT_RAD) - pitch_was)
        self._tilt_rad = (roll_goal, pitch_goal)
        roll_slope = (roll_goal - roll_was) / self._step_s
        pitch_slope = (pitch_goal - pitch_was) / self._step_s
        turn = _clip(sticks.wz * full.yaw_radps, _YAW_LIMIT_RADPS)
        torque = (
            INERTIA_KGM2[0] * (_TILT_P * (roll_goal - roll) + _TILT_D * (roll_slope - rate_x)),
            INERTIA_KGM2[1] * (_TILT_P * (pitch_goal - pitch) + _TILT_D * (pitch_slope - rate_y)),
            INERTIA_KGM2[2] * _YAW_P * (turn - rate_z),
        )

        climb = _clip(sticks.vz * full.up_mps, _CLIMB_LIMIT_MPS)
        # D acts on the acceleration that this very thrust makes: solved, not a step late.
        rise = (lift * _CLIMB_P * (climb - vz) + (lift - 1.0) * GRAVITY_MPS2) / (
            1.0 + lift * _CLIMB_D
        )
        upright = max(r[8], 0.5)
        thrust = MASS_KG * (rise + GRAVITY_MPS2) / upright
        return Loads(max(0.0, min(MAX_THRUST_N, thrust)), torque)


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
