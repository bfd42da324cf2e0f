"""The `ardrone` plant: a tilt stick, as the AR.Drone 2.0 was identified in flight.

tum_ardrone 6bcfb34 predicts the drone by first-order laws with eight constants c1..c8 (in degrees,
m/s, s; u the stick in [-1, 1]):

    tilt'    = c3 (c4 clip(u, +-0.5) - tilt)      v'  = c1 (c2 sin(tilt) - v)
    yawrate' = c5 (c6 u - yawrate)                vz' = c7 (c8 u (2 if u < 0) - vz)

Here thrust and torques do it on a rigid body. A tilted thrust that carries the weight accelerates
by g tan(tilt), where c1 c2 = 10.15 m/s2 was identified: 3 % less, and full speed is 3.60 instead
of 3.64 m/s. The other constants hold as they are.
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
    ROTOR_RADIUS_M,
    WEIGHT_N,
    BodyState,
    Loads,
    Sticks,
    Vector3,
    clip,
)
from services.sim.plant import Plant

TILT_PER_S, TILT_RAD = 7.0, math.radians(24.0)
"""c3, c4."""
YAW_PER_S = 25.0
"""c5; c6, 90 deg/s, is in common/sticks.py, and c8 too."""
CLIMB_PER_S = 0.8
"""c7."""
TILT_LIMIT_RAD, CLIMB_LIMIT_MPS, YAW_LIMIT_RADPS = 0.21, 0.7, 1.75
"""The limits of the driver, ardrone_autonomy. It sinks at up to 1.2 m/s: c8, identified."""

MOTOR_S = 0.02
"""rotors_simulator's ardrone.xacro (0d5209d) has 12.5 ms up and 25 ms down. Yaw has no such lag: a
motor turns the body by the very torque that speeds its rotor up."""
_RATE_PER_S = 30.0
"""Of the gyro's loop. With it and the motors' lag, tilt follows c3: 1 / _RATE_PER_S and MOTOR_S do
not change the mean lag of the loop around them, which is 1 / TILT_PER_S."""
_RISE, _SINK = Sticks(vz=1.0), Sticks(vz=-0.35)
"""Sticks of take-off and landing: 0.6 m/s up, 0.42 m/s down."""
_FULL = FULL_STICK["ardrone"]
_LIMIT = _FULL.linear_to


class ArdronePlant(Plant):
    """See the module; sticks are tilts in the heading frame.

    The driver leaves a trim error of a third of a degree: our choice, for an AR.Drone's hands-off
    wander with its optical hold switched off.
    """

    noise: ClassVar[float] = 0.0125
    drift: ClassVar[float] = 0.0125

    def __init__(self, step_s: float) -> None:
        self._share = 1.0 - math.exp(-step_s / MOTOR_S)
        # As much a step as makes exactly c5 of it.
        self._yaw_per_s = (1.0 - math.exp(-step_s * YAW_PER_S)) / step_s
        self.restart()
        self._thrust_n = WEIGHT_N

    def restart(self) -> None:
        """Forget the past, as when the rotors stop."""
        self._thrust_n = self._torque_x_nm = self._torque_y_nm = 0.0

    def fly(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The loads of the next step."""
        return self._loads(sticks, state, wind_mps, ground_effect(below_m))

    def _loads(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, effect: float) -> Loads:
        r = state.rotation
        pitch = math.asin(max(-1.0, min(1.0, -r[6])))
        roll = math.atan2(r[7], r[8])
        rate_x, rate_y, rate_z = state.to_body(state.angular_velocity_radps)
        vx, vy, vz = state.velocity_mps

        # Forward is nose down; the sticks' limit is a little below the driver's, 0.2094 rad.
        pitch_goal = clip(TILT_RAD * clip(sticks.vx, _LIMIT), TILT_LIMIT_RAD)
        roll_goal = -clip(TILT_RAD * clip(sticks.vy, _LIMIT), TILT_LIMIT_RAD)
        turn = clip(sticks.wz * _FULL.yaw_radps, YAW_LIMIT_RADPS)
        up = sticks.vz
        climb = min(CLIMB_LIMIT_MPS, (_FULL.up_mps if up > 0.0 else _FULL.down_mps) * up)

        torque_x = INERTIA_KGM2[0] * _RATE_PER_S * (TILT_PER_S * (roll_goal - roll) - rate_x)
        torque_y = INERTIA_KGM2[1] * _RATE_PER_S * (TILT_PER_S * (pitch_goal - pitch) - rate_y)
        drag = MASS_KG * DRAG_PER_S
        # c7 was identified with the drag in it, so the rotors carry that too.
        lift = MASS_KG * (GRAVITY_MPS2 + CLIMB_PER_S * (climb - vz)) + drag * vz
        thrust = max(0.0, min(MAX_THRUST_N, lift / max(r[8], 0.5)))

        share = self._share
        self._thrust_n += share * (thrust - self._thrust_n)
        self._torque_x_nm += share * (torque_x - self._torque_x_nm)
        self._torque_y_nm += share * (torque_y - self._torque_y_nm)
        return Loads(
            self._thrust_n * effect,
            (
                self._torque_x_nm,
                self._torque_y_nm,
                INERTIA_KGM2[2] * self._yaw_per_s * (turn - rate_z),
            ),
            (
                drag * (wind_mps[0] - vx),
                drag * (wind_mps[1] - vy),
                drag * (wind_mps[2] - vz),
            ),
        )

    def take_off(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """Climb at full stick."""
        return self.fly(_RISE, state, wind_mps, below_m)

    def land(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """Sink at a third of full stick.

        The firmware, which knows its height, makes up for what the ground carries: c7 alone would
        hover 0.13 m above it.
        """
        return self._loads(_SINK, state, wind_mps, 1.0)

    def fall(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """Only the air acts."""
        drag = MASS_KG * DRAG_PER_S
        vx, vy, vz = (drag * (w - v) for w, v in zip(wind_mps, state.velocity_mps, strict=True))
        return Loads(0.0, NO_LOADS.torque_nm, (vx, vy, vz))


def ground_effect(height_m: float) -> float:
    """How much more a rotor lifts at a height above ground (Cheeseman and Bennett, 1955)."""
    near = ROTOR_RADIUS_M / (4.0 * max(height_m, ROTOR_RADIUS_M / 2.0))
    return 1.0 / (1.0 - near * near)


PLANT = ArdronePlant
