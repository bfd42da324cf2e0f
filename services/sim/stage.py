"""The world and the vehicle's body in pybullet: forces in; motion, contacts and ranges out."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet

from common.frames import quaternion_of
from services.sim.body import (
    GRAVITY_MPS2,
    HULL_M,
    INERTIA_KGM2,
    MASS_KG,
    BodyState,
    Loads,
    Vector3,
)
from worlds import Body, Shape, Strip, Texture, World

_FAR_AWAY_M = 500.0
_FRICTION = 0.8
_RESTITUTION = 0.1
_REACH_M = math.hypot(*HULL_M) / 2.0
"""No point of the hull is farther from the body's origin."""
_MARGIN_M = 0.05
"""Nearer than this to the hull's sphere, contacts are looked for at each step."""
_COMPOUND = 16
"""Bodies in one of pybullet's: its most. It updates the bounds of each of its bodies at each step,
so 164 of them cost 12 us a step, 11 compounds of them 1 us."""

_SHAPES: dict[int, Shape] = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_SPHERE: "sphere",
}
_KINDS = {shape: kind for kind, shape in _SHAPES.items()}


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


UNTOUCHED = Touch()


class Stage:
    """A world with one vehicle in it.

    Args:
        world: what stands in it.
        step_s: of physics.
    """

    def __init__(self, world: World, step_s: float) -> None:
        self._world = world
        self._step_s = step_s
        self._id = int(pybullet.connect(pybullet.DIRECT))
        on = {"physicsClientId": self._id}
        self._on = on
        pybullet.setGravity(0.0, 0.0, -GRAVITY_MPS2, **on)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step_s, numSubSteps=1, deterministicOverlappingPairs=1, **on
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, **on)
        self._ground = pybullet.createMultiBody(0.0, plane, **on)
        self._groups = _neighbours(world.bodies)
        self._compounds = [add_bodies(group, **on) for group in self._groups]
        self._bounds_m = _bounds_of(world.bodies)
        hull = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[side / 2.0 for side in HULL_M], **on
        )
        self._vehicle = pybullet.createMultiBody(MASS_KG, hull, **on)
        for fixed in (self._ground, *self._compounds):
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
        self._leash_m = 0.0

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
        self._leash_m = 0.0

    def overlaps(self) -> bool:
        """Whether the vehicle is inside something that stands in the world."""
        return any(
            pybullet.getClosestPoints(self._vehicle, compound, 0.0, **self._on)
            for compound in self._compounds
        )

    def step(self, loads: Loads, state: BodyState) -> None:
        """Let the loads act for one step, beginning at the vehicle's `state`."""
        thrust_n, torque_nm, air_n = loads.thrust_n, loads.torque_nm, loads.air_n
        r = state.rotation
        pybullet.applyExternalForce(
            self._vehicle,
            -1,
            (
                thrust_n * r[2] + air_n[0],
                thrust_n * r[5] + air_n[1],
                thrust_n * r[8] + air_n[2],
            ),
            state.position_m,
            pybullet.WORLD_FRAME,
            self._id,
        )
        pybullet.applyExternalTorque(self._vehicle, -1, torque_nm, pybullet.LINK_FRAME, self._id)
        pybullet.stepSimulation(self._id)

    def state(self) -> BodyState:
        """The vehicle's motion now."""
        position, orientation = pybullet.getBasePositionAndOrientation(self._vehicle, self._id)
        velocity, rates = pybullet.getBaseVelocity(self._vehicle, self._id)
        return BodyState(
            position,
            orientation,
            pybullet.getMatrixFromQuaternion(orientation),
            velocity,
            rates,
        )

    def touch(self, state: BodyState) -> Touch:
        """What the vehicle presses against since the last step, which led to `state`.

        Far from everything it cannot touch anything before it has flown there, so pybullet is not
        even asked.
        """
        vx, vy, vz = state.velocity_mps
        self._leash_m -= (abs(vx) + abs(vy) + abs(vz)) * self._step_s
        if self._leash_m > 0.0:
            return UNTOUCHED
        clearance_m = self._clearance_m(state.position_m)
        if clearance_m > _MARGIN_M:
            self._leash_m = clearance_m
            return UNTOUCHED
        points = pybullet.getContactPoints(bodyA=self._vehicle, **self._on)
        # Near misses are listed too; only what pushes back is touched.
        touched = {point[2] for point in points if point[9] > 0.0}
        return Touch(self._ground in touched, bool(touched - {self._ground}))

    def _clearance_m(self, position_m: Vector3) -> float:
        """How far the hull is at least from all there is."""
        nearest_m = position_m[2]
        if len(self._bounds_m[0]):
            low, high = self._bounds_m
            outside = np.maximum(low - position_m, position_m - high)
            away = np.sqrt((np.maximum(outside, 0.0) ** 2).sum(axis=1))
            nearest_m = min(nearest_m, float(away.min()))
        return nearest_m - _REACH_M

    def ranges(self, position_m: Vector3, rays: list[Vector3], reach_m: float) -> list[float]:
        """How far it is from a place along unit vectors (world) to what is there, or `reach_m`.

        Begun inside the hull, a ray does not see it.
        """
        x, y, z = position_m
        ends = [(x + dx * reach_m, y + dy * reach_m, z + dz * reach_m) for dx, dy, dz in rays]
        hits = pybullet.rayTestBatch([position_m] * len(ends), ends, **self._on)
        return [reach_m if hit[0] < 0 else hit[2] * reach_m for hit in hits]

    def scene(self) -> Scene:
        """What cameras see, read back from pybullet so that what is seen is what collides."""
        bodies: list[Body] = []
        for compound, group in zip(self._compounds, self._groups, strict=True):
            parts = pybullet.getCollisionShapeData(compound, -1, **self._on)
            for part, body in zip(parts, group, strict=True):
                size = part[3]
                if part[2] == pybullet.GEOM_CYLINDER:
                    size = (2.0 * part[3][1], 2.0 * part[3][1], part[3][0])
                elif part[2] == pybullet.GEOM_SPHERE:
                    size = (2.0 * part[3][0],) * 3
                bodies.append(Body(_SHAPES[part[2]], size, part[5], part[6], body.texture))
        return Scene(tuple(bodies), self._world.strips, self._world.ground)


def add_bodies(bodies: tuple[Body, ...], **on: int) -> int:
    """Put bodies of a world as one into the pybullet that `on` names; returns its number there."""
    shape = pybullet.createCollisionShapeArray(
        shapeTypes=[_KINDS[body.shape] for body in bodies],
        halfExtents=[[side / 2.0 for side in body.size_m] for body in bodies],
        radii=[body.size_m[0] / 2.0 for body in bodies],
        lengths=[body.size_m[2] for body in bodies],
        collisionFramePositions=[body.position_m for body in bodies],
        collisionFrameOrientations=[body.orientation for body in bodies],
        **on,
    )
    # As a plain rigid body: as a multibody it would make a step dearer.
    return int(pybullet.createMultiBody(0.0, shape, **on))


def add_visible(body: Body, colour: tuple[float, ...], **on: int) -> None:
    """Put what is seen of a body of a world into the pybullet that `on` names."""
    width, height = body.size_m[0], body.size_m[2]
    form: dict[str, Any]
    if body.shape == "box":
        form = {"halfExtents": [side / 2.0 for side in body.size_m]}
    elif body.shape == "cylinder":
        form = {"radius": width / 2.0, "length": height}
    else:
        form = {"radius": width / 2.0}
    shape = pybullet.createVisualShape(_KINDS[body.shape], rgbaColor=colour, **form, **on)
    pybullet.createMultiBody(0.0, -1, shape, body.position_m, body.orientation, **on)


def _neighbours(bodies: tuple[Body, ...]) -> list[tuple[Body, ...]]:
    """The bodies in groups of at most _COMPOUND, each of what stands close together."""
    if not bodies:
        return []
    if len(bodies) <= _COMPOUND:
        return [bodies]
    places = np.asarray([body.position_m for body in bodies])
    axis = int(np.argmax(np.ptp(places, axis=0)))
    order = np.argsort(places[:, axis], kind="stable")
    half = len(bodies) // 2
    near, far = (tuple(bodies[i] for i in part) for part in (order[:half], order[half:]))
    return [*_neighbours(near), *_neighbours(far)]


def _bounds_of(bodies: tuple[Body, ...]) -> tuple[Any, Any]:
    """The lowest and highest corners of bodies' bounding boxes, (N, 3) each."""
    low, high = [], []
    for body in bodies:
        turn = np.abs(np.reshape(pybullet.getMatrixFromQuaternion(body.orientation), (3, 3)))
        half = turn @ np.asarray(body.size_m) / 2.0
        low.append(np.asarray(body.position_m) - half)
        high.append(np.asarray(body.position_m) + half)
    return np.reshape(low, (-1, 3)), np.reshape(high, (-1, 3))
