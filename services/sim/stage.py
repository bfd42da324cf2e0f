"""A world in pybullet, and the vehicles' bodies in it."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet

from services.sim.body import GRAVITY_MPS2, Vector3
from services.sim.build import Build
from services.sim.hull import KINDS, RESTITUTION, Hull
from services.sim.scenery import MOST, add_bodies
from worlds import Body, Shape, Strip, Texture, World

_FRICTION = 0.8
_FIRST_BIT = 6
"""Of vehicles' groups; Bullet uses those below."""
_SHAPES: dict[int, Shape] = {kind: shape for shape, kind in KINDS.items()}


@dataclass(frozen=True, eq=False)
class Scene:
    """What cameras see: the bodies as pybullet has them, and the ground."""

    bodies: tuple[Body, ...]
    strips: tuple[Strip, ...]
    ground: Texture


class Stage:
    """A world, and the vehicles that were added to it.

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
        self._groups = [
            world.bodies[begin : begin + MOST] for begin in range(0, len(world.bodies), MOST)
        ]
        self._scenery = [add_bodies(group, **on) for group in self._groups]
        self._bounds_m = _bounds_of(world.bodies)
        for fixed in (self._ground, *self._scenery):
            pybullet.changeDynamics(
                fixed, -1, lateralFriction=_FRICTION, restitution=RESTITUTION, **on
            )
        self._hulls: list[Hull] = []

    @property
    def client(self) -> int:
        """Its number in pybullet."""
        return self._id

    def close(self) -> None:
        """Leave pybullet."""
        pybullet.disconnect(**self._on)

    def add(self, build: Build) -> Hull:
        """Put in another vehicle; it has to be placed."""
        taken = {hull.group for hull in self._hulls}
        group = next(1 << bit for bit in itertools.count(_FIRST_BIT) if 1 << bit not in taken)
        fixed = tuple(self._scenery)
        hull = Hull(self._id, build, self._step_s, group, self._ground, fixed, self._away_m)
        self._hulls.append(hull)
        self._acquaint()
        return hull

    def replace(self, hull: Hull, build: Build) -> Hull:
        """Put in another vehicle for one that is taken out."""
        self._hulls.remove(hull)
        hull.remove()
        return self.add(build)

    def _acquaint(self) -> None:
        for hull in self._hulls:
            hull.others = tuple(other for other in self._hulls if other is not hull)

    def step(self) -> None:
        """Move on by one step; the vehicles have been pushed."""
        pybullet.stepSimulation(self._id)

    def _away_m(self, position_m: Vector3) -> float:
        """How far a place is at least from the ground and from all that stands there."""
        nearest_m = position_m[2]
        if len(self._bounds_m[0]):
            low, high = self._bounds_m
            outside = np.maximum(low - position_m, position_m - high)
            away = np.sqrt((np.maximum(outside, 0.0) ** 2).sum(axis=1))
            nearest_m = min(nearest_m, float(away.min()))
        return nearest_m

    def ranges(
        self, hull: Hull, position_m: Vector3, rays: list[Vector3], reach_m: float
    ) -> list[float]:
        """How far it is from a place along unit vectors (world) to what is there, or `reach_m`.

        The hull, which is a vehicle's own, is not seen.
        """
        x, y, z = position_m
        ends = [(x + dx * reach_m, y + dy * reach_m, z + dz * reach_m) for dx, dy, dz in rays]
        hits = pybullet.rayTestBatch(
            [position_m] * len(ends), ends, collisionFilterMask=~hull.group, **self._on
        )
        return [reach_m if hit[0] < 0 else hit[2] * reach_m for hit in hits]

    def scene(self) -> Scene:
        """What cameras see, read back from pybullet so that what is seen is what collides."""
        bodies: list[Body] = []
        for number, group in zip(self._scenery, self._groups, strict=True):
            parts = pybullet.getCollisionShapeData(number, -1, **self._on)
            for part, body in zip(parts, group, strict=True):
                size = part[3]
                if part[2] == pybullet.GEOM_CYLINDER:
                    size = (2.0 * part[3][1], 2.0 * part[3][1], part[3][0])
                elif part[2] == pybullet.GEOM_SPHERE:
                    size = (2.0 * part[3][0],) * 3
                bodies.append(Body(_SHAPES[part[2]], size, part[5], part[6], body.texture))
        return Scene(tuple(bodies), self._world.strips, self._world.ground)


def add_visible(body: Body, colour: tuple[float, ...], **on: int) -> int:
    """Put what is seen of a body into the pybullet that `on` names; its number there."""
    width, height = body.size_m[0], body.size_m[2]
    form: dict[str, Any]
    if body.shape == "box":
        form = {"halfExtents": [side / 2.0 for side in body.size_m]}
    elif body.shape == "cylinder":
        form = {"radius": width / 2.0, "length": height}
    else:
        form = {"radius": width / 2.0}
    shape = pybullet.createVisualShape(KINDS[body.shape], rgbaColor=colour, **form, **on)
    return int(pybullet.createMultiBody(0.0, -1, shape, body.position_m, body.orientation, **on))


def _bounds_of(bodies: tuple[Body, ...]) -> tuple[Any, Any]:
    """The lowest and highest corners of bodies' bounding boxes, (N, 3) each."""
    low, high = [], []
    for body in bodies:
        turn = np.abs(np.reshape(pybullet.getMatrixFromQuaternion(body.orientation), (3, 3)))
        half = turn @ np.asarray(body.size_m) / 2.0
        low.append(np.asarray(body.position_m) - half)
        high.append(np.asarray(body.position_m) + half)
    return np.reshape(low, (-1, 3)), np.reshape(high, (-1, 3))
