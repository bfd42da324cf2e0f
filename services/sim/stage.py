"""The world and the vehicle's body in pybullet: forces in; motion, contacts and ranges out."""

import math
from dataclasses import dataclass
from typing import Any

import pybullet

from common.frames import quaternion_of
from services.sim.plant import GRAVITY_MPS2, INERTIA_KGM2, MASS_KG, BodyState, Loads, Vector3
from worlds import Body, Shape, Strip, Texture, World

HULL_M: Vector3 = (0.52, 0.52, 0.11)
REST_HEIGHT_M = HULL_M[2] / 2.0
"""Of the body's origin when it stands on the ground."""
_FAR_AWAY_M = 500.0
_FRICTION = 0.8
_RESTITUTION = 0.1

_SHAPES: dict[int, Shape] = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_SPHERE: "sphere",
}


@dataclass(frozen=True, eq=False)
class Scene:
    """What cameras see: the bodies as pybullet has them, and the ground."""

    bodies: tuple[Body, ...]
    strips: tuple[Strip, ...]
    ground: Texture


@dataclass(frozen=True, slots=True)
class Touch:
    """What the hull presses against."""

    ground: bool = False
    body: bool = False


class Stage:
    """A world with one vehicle in it.

    Args:
        world: what stands in it.
        step_s: of physics.
    """

    def __init__(self, world: World, step_s: float) -> None:
        self._world = world
        self._id = int(pybullet.connect(pybullet.DIRECT))
        on = {"physicsClientId": self._id}
        self._on = on
        pybullet.setGravity(0.0, 0.0, -GRAVITY_MPS2, **on)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step_s, numSubSteps=1, deterministicOverlappingPairs=1, **on
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, **on)
        self._ground = pybullet.createMultiBody(0.0, plane, **on)
        self._textures: dict[int, Texture] = {}
        for body in world.bodies:
            self._textures[add_body(body, **on)] = body.texture
        hull = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[side / 2.0 for side in HULL_M], **on
        )
        self._vehicle = pybullet.createMultiBody(MASS_KG, hull, **on)
        for fixed in (self._ground, *self._textures):
            pybullet.changeDynamics(
                fixed, -1, lateralFriction=_FRICTION, restitution=_RESTITUTION, **on
            )
        # pybullet's own damping of 0.04 would take 7.5 % of the speed every second.
        pybullet.changeDynamics(
            self._vehicle,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=INERTIA_KGM2,
            lateralFriction=_FRICTION,
            restitution=_RESTITUTION,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            **on,
        )

    @property
    def client(self) -> int:
        """Its number in pybullet."""
        return self._id

    def close(self) -> None:
        """Leave pybullet."""
        pybullet.disconnect(**self._on)

    def place(self, position_m: Vector3, yaw_rad: float) -> None:
        """Put the vehicle down at rest, level."""
        still = (0.0, 0.0, 0.0)
        # Far away first: contacts that it has there would be remembered here.
        for place_m in ((0.0, 0.0, _FAR_AWAY_M), position_m):
            self._put(place_m, quaternion_of(0.0, 0.0, yaw_rad), still, still)

    def restore(self, state: BodyState) -> None:
        """Put the vehicle back into a motion it had."""
        self._put(
            state.position_m, state.orientation, state.velocity_mps, state.angular_velocity_radps
        )

    def _put(
        self, position_m: Vector3, turn: tuple[float, ...], velocity: Vector3, rates: Vector3
    ) -> None:
        pybullet.resetBasePositionAndOrientation(self._vehicle, position_m, turn, **self._on)
        pybullet.resetBaseVelocity(self._vehicle, velocity, rates, **self._on)
        # Rays find nothing before the first detection.
        pybullet.performCollisionDetection(**self._on)

    def overlaps(self) -> bool:
        """Whether the vehicle is inside something that stands in the world."""
        return any(
            pybullet.getClosestPoints(self._vehicle, body, 0.0, **self._on)
            for body in self._textures
        )

    def step(self, loads: Loads) -> None:
        """Let the loads act for one step."""
        if loads.thrust_n:
            pybullet.applyExternalForce(
                self._vehicle,
                -1,
                (0.0, 0.0, loads.thrust_n),
                (0.0, 0.0, 0.0),
                pybullet.LINK_FRAME,
                **self._on,
            )
            pybullet.applyExternalTorque(
                self._vehicle, -1, loads.torque_nm, pybullet.LINK_FRAME, **self._on
            )
        pybullet.stepSimulation(**self._on)

    def state(self) -> BodyState:
        """The vehicle's motion now."""
        position, orientation = pybullet.getBasePositionAndOrientation(self._vehicle, **self._on)
        velocity, rates = pybullet.getBaseVelocity(self._vehicle, **self._on)
        return BodyState(
            position,
            orientation,
            pybullet.getMatrixFromQuaternion(orientation),
            velocity,
            rates,
        )

    def touch(self) -> Touch:
        """What the vehicle presses against since the last step."""
        points = pybullet.getContactPoints(bodyA=self._vehicle, **self._on)
        if not points:
            return Touch()
        # Near misses are listed too; only what pushes back is touched.
        touched = {point[2] for point in points if point[9] > 0.0}
        return Touch(self._ground in touched, bool(touched - {self._ground}))

    def range_below(self, state: BodyState, reach_m: float) -> float:
        """The distance from the body's origin along body -z to what is there, at most `reach_m`."""
        x, y, z = state.position_m
        down = (-state.rotation[2], -state.rotation[5], -state.rotation[8])
        end = (x + down[0] * reach_m, y + down[1] * reach_m, z + down[2] * reach_m)
        # Begun inside the hull, a ray does not see it.
        body, _, fraction, _, _ = pybullet.rayTest((x, y, z), end, **self._on)[0]
        return reach_m if body < 0 else float(fraction * reach_m)

    def scene(self) -> Scene:
        """What cameras see, read back from pybullet so that what is seen is what collides."""
        bodies = []
        for body, texture in self._textures.items():
            shape = pybullet.getVisualShapeData(body, **self._on)[0]
            position, orientation = pybullet.getBasePositionAndOrientation(body, **self._on)
            size = shape[3]
            if shape[2] == pybullet.GEOM_CYLINDER:
                size = (2.0 * shape[3][1], 2.0 * shape[3][1], shape[3][0])
            elif shape[2] == pybullet.GEOM_SPHERE:
                size = (2.0 * shape[3][0],) * 3
            bodies.append(Body(_SHAPES[shape[2]], size, position, orientation, texture))
        return Scene(tuple(bodies), self._world.strips, self._world.ground)


def add_body(body: Body, **on: int) -> int:
    """Put a body of a world into the pybullet that `on` names; returns its number there."""
    length, _, height = body.size_m
    form: dict[str, Any]
    if body.shape == "box":
        kind, form = pybullet.GEOM_BOX, {"halfExtents": [side / 2.0 for side in body.size_m]}
        seen = form
    elif body.shape == "cylinder":
        kind, form = pybullet.GEOM_CYLINDER, {"radius": length / 2.0, "height": height}
        seen = {"radius": length / 2.0, "length": height}
    else:
        kind = pybullet.GEOM_SPHERE
        form = seen = {"radius": length / 2.0}
    return int(
        pybullet.createMultiBody(
            0.0,
            pybullet.createCollisionShape(kind, **form, **on),
            pybullet.createVisualShape(kind, **seen, **on),
            body.position_m,
            body.orientation,
            # As plain rigid bodies: as multibodies, 160 of them make a step five times dearer.
            useMaximalCoordinates=True,
            **on,
        )
    )


def tilt_of(state: BodyState) -> float:
    """The angle in rad between body z and up."""
    return math.acos(max(-1.0, min(1.0, state.rotation[8])))
