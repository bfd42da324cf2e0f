"""How a vehicle is built: what it weighs, its size, how it looks, where its instruments sit."""

import math
from dataclasses import dataclass

import numpy as np

from common.camera import DOWN, FRONT, Mount
from common.frames import rotation_of
from services.sim.body import HULL_M, INERTIA_KGM2, MASS_KG, Vector3
from worlds import Body

INSTRUMENTS = frozenset({"imu", "altimeter", "camera/front", "camera/down"})
"""What a vehicle may carry: the topics of each."""
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Build:
    """A rigid body, as pybullet has it and as others see it.

    Attributes:
        mass_kg: of all of it.
        inertia_kgm2: about body x, y, z.
        hull: what collides, in body coordinates, whose origin is the centre of mass.
        look: what others see, in the same.
        friction: of its hull; pybullet multiplies it by that of what it touches.
        friction_tipped: the same once it lies on its side or its back; None is no other.
        front: where the front camera sits.
        down: where the camera that looks down sits.
        sensors: the topics of the instruments that it has.
    """

    mass_kg: float
    inertia_kgm2: Vector3
    hull: tuple[Body, ...]
    look: tuple[Body, ...]
    friction: float = 0.8
    friction_tipped: float | None = None
    front: Mount = FRONT
    down: Mount = DOWN
    sensors: frozenset[str] = INSTRUMENTS

    @property
    def rest_height_m(self) -> float:
        """Of the body's origin when it stands on the ground."""
        return max(
            0.5 * float(np.abs(rotation_of(each.orientation)[2]) @ each.size_m) - each.position_m[2]
            for each in self.hull
        )

    @property
    def reach_m(self) -> float:
        """No point of the hull is farther from the body's origin."""
        return max(
            math.hypot(*each.position_m) + math.hypot(*each.size_m) / 2.0 for each in self.hull
        )


def _ring(x: float, y: float) -> Body:
    return Body("cylinder", (0.26, 0.26, 0.05), (x, y, 0.02), _UPRIGHT, "asphalt")


ARDRONE = Build(
    MASS_KG,
    INERTIA_KGM2,
    hull=(Body("box", HULL_M, (0.0, 0.0, 0.0), _UPRIGHT, "asphalt"),),
    look=(
        Body("box", (0.44, 0.12, 0.09), (0.02, 0.0, 0.0), _UPRIGHT, "container"),
        *(_ring(x, y) for x in (-0.13, 0.13) for y in (-0.13, 0.13)),
    ),
)
"""The AR.Drone 2.0 in its indoor hull, whose four rings are as wide as the box that collides."""
