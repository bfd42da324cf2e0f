"""The `rover` plant: a ground robot with differential drive.

Its stick is the drones': `vx` is a speed, `wz` a turn rate; `vy` and `vz` do nothing. Size, weight
and life of a charge are those that the maker of the Clearpath Jackal states; the rest is our choice
for such a robot. The hull slides without friction and the wheels do the rest, by forces on the
body: forward as the motors drive them, sideways against any slip, as far as rubber holds on tarmac.
"""

import math
from typing import ClassVar

from common.messages import FollowingRates, FullStickSpeeds
from services.sim.body import GRAVITY_MPS2, NO_LOADS, BodyState, Loads, Sticks, Vector3, clip
from services.sim.build import Build
from services.sim.plant import Plant
from worlds import Body

MASS_KG = 17.0
SIZE_M: Vector3 = (0.508, 0.430, 0.250)
FORWARD_MPS, TURN_RADPS = 1.0, 1.5
"""At full stick."""
MOTOR_S = 0.1
"""The lag of the wheels behind the stick."""
MOTOR_MPS2, MOTOR_RADPS2 = 2.5, 8.0
"""The motors drive no harder."""
GRIP = 0.7
"""The friction of tyres."""
_HALF_TRACK_M = 0.19
_FOOT_M = (0.2, 0.165)
_ON_GROUND_M = 0.03
"""Higher than this above where they rest, the wheels hang in the air."""
_UPRIGHT_COS = 0.5
"""Tilted more, it does not stand on its wheels."""
_INERTIA_KGM2: Vector3 = (
    MASS_KG / 12.0 * (SIZE_M[1] ** 2 + SIZE_M[2] ** 2),
    MASS_KG / 12.0 * (SIZE_M[0] ** 2 + SIZE_M[2] ** 2),
    MASS_KG / 12.0 * (SIZE_M[0] ** 2 + SIZE_M[1] ** 2),
)
"""Of a box that is evenly filled."""
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)
_AXLE_ACROSS = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def _foot(x: float, y: float) -> Body:
    """What it stands on: a ball touches the ground in one point, however it turns."""
    return Body("sphere", (0.1, 0.1, 0.1), (x, y, -0.075), _UPRIGHT, "post")


def _wheel(x: float, y: float) -> Body:
    return Body("cylinder", (0.2, 0.2, 0.05), (x, y, -0.025), _AXLE_ACROSS, "asphalt")


class RoverPlant(Plant):
    """See the module; sticks are a speed and a turn rate."""

    build: ClassVar[Build] = Build(
        MASS_KG,
        _INERTIA_KGM2,
        hull=(
            Body("box", (SIZE_M[0], SIZE_M[1], 0.225), (0.0, 0.0, 0.0125), _UPRIGHT, "container"),
            *(_foot(x, y) for x in (-_FOOT_M[0], _FOOT_M[0]) for y in (-_FOOT_M[1], _FOOT_M[1])),
        ),
        look=(
            Body("box", (0.42, 0.32, 0.16), (0.0, 0.0, 0.02), _UPRIGHT, "container"),
            Body("box", (0.12, 0.2, 0.025), (0.1, 0.0, 0.1125), _UPRIGHT, "metal"),
            *(_wheel(x, y) for x in (-0.13, 0.13) for y in (-_HALF_TRACK_M, _HALF_TRACK_M)),
        ),
        friction=0.0,
        friction_tipped=0.8,
    )
    flies: ClassVar[bool] = False
    life_s: ClassVar[float] = 4 * 3600.0
    full_stick: ClassVar[FullStickSpeeds | None] = (FORWARD_MPS, 0.0, 0.0, 0.0, TURN_RADPS)
    rates: ClassVar[FollowingRates | None] = (1.0 / MOTOR_S, 0.0, 1.0 / MOTOR_S)

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._share = 1.0 - math.exp(-step_s / MOTOR_S)
        self.restart()

    def restart(self) -> None:
        """The wheels stand still."""
        self._wheels_mps = self._turn_radps = 0.0

    def fly(self, sticks: Sticks, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The loads of the next step."""
        step_s, share = self._step_s, self._share
        goal_mps, goal_radps = FORWARD_MPS * clip(sticks.vx, 1.0), TURN_RADPS * clip(sticks.wz, 1.0)
        self._wheels_mps += clip(share * (goal_mps - self._wheels_mps), MOTOR_MPS2 * step_s)
        self._turn_radps += clip(share * (goal_radps - self._turn_radps), MOTOR_RADPS2 * step_s)
        return self._traction(state, below_m, self._wheels_mps, self._turn_radps)

    def fall(self, state: BodyState, wind_mps: Vector3, below_m: float) -> Loads:
        """The wheels are locked."""
        return self._traction(state, below_m, 0.0, 0.0)

    def _traction(
        self, state: BodyState, below_m: float, forward_mps: float, turn_radps: float
    ) -> Loads:
        """What the ground does to wheels that turn so, sideways slip included."""
        r, (vx, vy, _) = state.rotation, state.velocity_mps
        if below_m > SIZE_M[2] / 2.0 + _ON_GROUND_M or r[8] < _UPRIGHT_COS:
            return NO_LOADS
        level = math.hypot(r[0], r[3])
        cos, sin = r[0] / level, r[3] / level
        ahead = (forward_mps - (cos * vx + sin * vy)) / self._step_s
        left = (sin * vx - cos * vy) / self._step_s
        # Rubber gives way in whatever direction it is asked for too much.
        most = GRIP * GRAVITY_MPS2
        give = min(1.0, most / max(math.hypot(ahead, left), 1e-9))
        ahead, left = give * ahead * MASS_KG, give * left * MASS_KG
        rate = state.to_body(state.angular_velocity_radps)[2]
        torque = _INERTIA_KGM2[2] * (turn_radps - rate) / self._step_s
        turn_nm = clip(torque, most * MASS_KG * _HALF_TRACK_M)
        return Loads(
            0.0,
            (0.0, 0.0, turn_nm),
            (cos * ahead - sin * left, sin * ahead + cos * left, 0.0),
        )


PLANT = RoverPlant
