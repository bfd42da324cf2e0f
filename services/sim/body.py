"""The flying body: what it weighs, how it moves, what pushes it."""

import math

import msgspec

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

GRAVITY_MPS2 = 9.81
MASS_KG = 0.42
WEIGHT_N = MASS_KG * GRAVITY_MPS2
INERTIA_KGM2: Vector3 = (2.237568e-3, 2.985236e-3, 4.80374e-3)
"""About body x, y, z: the figures that public models of the AR.Drone 2.0 share (for 0.429 kg)."""
HULL_M: Vector3 = (0.52, 0.52, 0.11)
MAX_THRUST_N = 30.0 / 1.477 * MASS_KG
"""tum_simulator allows 30 N on 1.477 kg; this is the same acceleration."""
DRAG_PER_S = 0.58
"""The drag of the air on the body as a share of its mass: c1 of tum_ardrone 6bcfb34."""
ROTOR_RADIUS_M = 0.1
"""rotors_simulator's ardrone.xacro (0d5209d)."""


class BodyState(msgspec.Struct, frozen=True, gc=False):
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

    @property
    def tilt_rad(self) -> float:
        """The angle between body z and up."""
        return math.acos(max(-1.0, min(1.0, self.rotation[8])))


class Sticks(msgspec.Struct, frozen=True, gc=False):
    """Fractions of full stick; noise may carry them a little beyond 1."""

    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    wz: float = 0.0


class Loads(msgspec.Struct, frozen=True, gc=False):
    """What acts on the body besides gravity and contacts.

    Attributes:
        thrust_n: of the rotors, along body z.
        torque_nm: of the rotors, about the body's axes.
        air_n: of the air on the hull, or of the ground on wheels, world.
    """

    thrust_n: float
    torque_nm: Vector3
    air_n: Vector3


CALM: Vector3 = (0.0, 0.0, 0.0)
NO_LOADS = Loads(0.0, CALM, CALM)


def clip(value: float, limit: float) -> float:
    """The value within +-limit."""
    return -limit if value < -limit else limit if value > limit else value
