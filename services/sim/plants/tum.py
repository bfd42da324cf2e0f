"""The `tum` plant: a velocity stick, its loops acting by thrust and torques on a rigid body.

The loops are those of tum_simulator a020d89 (references: its simple quadrotor controller); what
they command is divided by inertia and mass, so they act alike on any body. Like the original it
knows no drag of its own; wind pushes it as hard as it pushes the `ardrone` plant at rest.
"""

import math
from typing import ClassVar

from common.sticks import FULL_STICK
from services.sim.body import (
    DRAG_PER_S,
    GRAVITY_MPS2,
    INERTIA_KGM2,
    MASS_KG,
    MAX_THRUST_N,
    NO_LOADS,
    BodyState,
    Loads,
    Sticks,
    Vector3,
    clip,
)
from services.sim.plant import Plant

_VELOCITY_P, _VELOCITY_D, _VELOCITY_LIMIT_MPS = 5.0, 1.0, 2.0
_TILT_P, _TILT_D, _TILT_LIMIT_RAD = 10.0, 5.0, 0.5
_YAW_P, _YAW_LIMIT_RADPS = 2.0, 1.5
_CLIMB_P, _CLIMB_D, _CLIMB_LIMIT_MPS = 5.0, 1.0, 0.5
_TILT_FILTER_S = 0.05
"""The tilt loop differentiates its command. Unfiltered, a step of the stick would ask the rotors
for several N m within one step of physics; with this the peak is 0.1 N m."""
_TAKE_OFF_LIFT, _LANDING_LIFT = 1.5, 0.8
_NEUTRAL = Sticks()
_FULL = FULL_STICK["tum"]


class TumPlant(Plant):
    """See the module; sticks are speeds in the heading frame."""

    noise: ClassVar[float] = 0.05
    drift: ClassVar[float] = 0.03

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._share = step_s / (step_s + _TILT_FILTER_S)
        self.restart()

    def restart(self) -> None:
        """Forget the past, as when the rotors stop."""
        self._velocity_mps: tuple[float, float] | None = None
        self._roll_rad = self._pitch_rad = 0.0

    def fly(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The loads of the next step."""
        return self._loads(sticks, state, wind_mps, 1.0)

    def take_off(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """Half as much thrust again."""
        return self._loads(_NEUTRAL, state, wind_mps, _TAKE_OFF_LIFT)

    def land(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """A fifth less thrust."""
        return self._loads(_NEUTRAL, state, wind_mps, _LANDING_LIFT)

    def fall(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """Nothing acts."""
        return NO_LOADS

    def _loads(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, lift: float) -> Loads:
        r = state.rotation
        # The heading's direction: the body's x axis laid on the ground.
        level = math.hypot(r[0], r[3]) or 1.0
        cos, sin = r[0] / level, r[3] / level
        pitch = math.asin(max(-1.0, min(1.0, -r[6])))
        roll = math.atan2(r[7], r[8])
        rate_x, rate_y, rate_z = state.to_body(state.angular_velocity_radps)

        vx_w, vy_w, vz = state.velocity_mps
        vx, vy = cos * vx_w + sin * vy_w, cos * vy_w - sin * vx_w
        last_x, last_y = self._velocity_mps or (vx_w, vy_w)
        self._velocity_mps = (vx_w, vy_w)
        step_s = self._step_s
        dx, dy = (vx_w - last_x) / step_s, (vy_w - last_y) / step_s
        ax, ay = cos * dx + sin * dy, cos * dy - sin * dx

        goal_x = clip(sticks.vx * _FULL.forward_mps, _VELOCITY_LIMIT_MPS)
        goal_y = clip(sticks.vy * _FULL.left_mps, _VELOCITY_LIMIT_MPS)
        want_pitch = (_VELOCITY_P * (goal_x - vx) - _VELOCITY_D * ax) / GRAVITY_MPS2
        want_roll = -(_VELOCITY_P * (goal_y - vy) - _VELOCITY_D * ay) / GRAVITY_MPS2
        roll_step = self._share * (clip(want_roll, _TILT_LIMIT_RAD) - self._roll_rad)
        pitch_step = self._share * (clip(want_pitch, _TILT_LIMIT_RAD) - self._pitch_rad)
        self._roll_rad += roll_step
        self._pitch_rad += pitch_step
        turn = clip(sticks.wz * _FULL.yaw_radps, _YAW_LIMIT_RADPS)
        torque = (
            INERTIA_KGM2[0]
            * (_TILT_P * (self._roll_rad - roll) + _TILT_D * (roll_step / step_s - rate_x)),
            INERTIA_KGM2[1]
            * (_TILT_P * (self._pitch_rad - pitch) + _TILT_D * (pitch_step / step_s - rate_y)),
            INERTIA_KGM2[2] * _YAW_P * (turn - rate_z),
        )

        climb = clip(sticks.vz * _FULL.up_mps, _CLIMB_LIMIT_MPS)
        # D acts on the acceleration that this very thrust makes: solved, not a step late.
        rise = (lift * _CLIMB_P * (climb - vz) + (lift - 1.0) * GRAVITY_MPS2) / (
            1.0 + lift * _CLIMB_D
        )
        thrust = MASS_KG * (rise + GRAVITY_MPS2) / max(r[8], 0.5)
        push = MASS_KG * DRAG_PER_S
        air = (push * wind_mps[0], push * wind_mps[1], push * wind_mps[2])
        return Loads(max(0.0, min(MAX_THRUST_N, thrust)), torque, air)


PLANT = TumPlant
