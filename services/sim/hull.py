"""A vehicle's rigid body in pybullet: forces in; motion and contacts out."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pybullet

from common.frames import quaternion_of
from services.sim.body import BodyState, Loads, Vector3
from services.sim.build import Build
from worlds import Body, Shape

KINDS: dict[Shape, int] = {
    "box": pybullet.GEOM_BOX,
    "cylinder": pybullet.GEOM_CYLINDER,
    "sphere": pybullet.GEOM_SPHERE,
}
_FAR_AWAY_M = 500.0
RESTITUTION = 0.1
_TIPPED_COS = math.cos(1.0)
_CARRIED_COS = math.cos(0.8)
"""A push that leans less from upright than this carries the vehicle, another bars its way."""
_ALL = -1
"""The mask of what touches everything."""
_MARGIN_M = 0.05
"""Nearer than this to the hull's sphere, contacts are looked for at each step."""


@dataclass(frozen=True, slots=True)
class Touch:
    """What the hull presses against.

    Attributes:
        ground: the ground.
        body: what stands there, or another vehicle.
        side: any of these, which pushes it sideways rather than up or down.
    """

    ground: bool = False
    body: bool = False
    side: bool = False


UNTOUCHED = Touch()


class Hull:
    """The body of one vehicle.

    Args:
        client: the number of the pybullet it is put into.
        build: of the vehicle.
        step_s: of physics.
        group: a bit of its own, by which rays pass it over.
        ground: the number of the ground.
        fixed: the numbers of all that stands there.
        away_m: how far a place is at least from all that stands there.
    """

    def __init__(
        self,
        client: int,
        build: Build,
        step_s: float,
        group: int,
        ground: int,
        fixed: tuple[int, ...],
        away_m: Callable[[Vector3], float],
    ) -> None:
        self._id = client
        self._on = on = {"physicsClientId": client}
        self._step_s = step_s
        self.group = group
        self._ground, self._fixed = ground, fixed
        self._away_m = away_m
        self._rest_height_m = build.rest_height_m
        self._reach_m = build.reach_m
        """No point of the hull is farther from the body's origin."""
        self.others: tuple[Hull, ...] = ()
        self.position_m: Vector3 = (0.0, 0.0, 0.0)
        """Where it was last seen."""
        shape = collision_shape(build.hull, **on)
        self._body = pybullet.createMultiBody(build.mass_kg, shape, **on)
        pybullet.setCollisionFilterGroupMask(self._body, -1, group, _ALL, **on)
        # pybullet's own damping of 0.04 would take 7.5 % of the speed every second.
        pybullet.changeDynamics(
            self._body,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=build.inertia_kgm2,
            lateralFriction=build.friction,
            restitution=RESTITUTION,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            **on,
        )
        self._leash_m = 0.0
        tipped = build.friction_tipped
        self._frictions = (build.friction, build.friction if tipped is None else tipped)
        self._is_tipped = False

    def remove(self) -> None:
        """Take it out of the world."""
        pybullet.removeBody(self._body, **self._on)

    def place(self, position_m: Vector3, yaw_rad: float) -> None:
        """Put the vehicle down at rest, level; on the ground rather than in it."""
        still = (0.0, 0.0, 0.0)
        x, y, z = position_m
        # Far away first: contacts that it has there would be remembered here.
        for place_m in ((0.0, 0.0, _FAR_AWAY_M), (x, y, max(z, self._rest_height_m))):
            self._put(place_m, quaternion_of(0.0, 0.0, yaw_rad), still, still)

    def restore(self, state: BodyState) -> None:
        """Put the vehicle back into a motion it had."""
        self._put(
            state.position_m, state.orientation, state.velocity_mps, state.angular_velocity_radps
        )

    def _put(
        self, position_m: Vector3, turn: tuple[float, ...], velocity: Vector3, rates: Vector3
    ) -> None:
        pybullet.resetBasePositionAndOrientation(self._body, position_m, turn, **self._on)
        pybullet.resetBaseVelocity(self._body, velocity, rates, **self._on)
        # Rays find nothing before the first detection.
        pybullet.performCollisionDetection(**self._on)
        self._leash_m = 0.0

    def overlaps(self, room_m: float = 0.0) -> bool:
        """Whether something in the world, or another vehicle, is in it or nearer than a room."""
        return any(
            pybullet.getClosestPoints(self._body, other, room_m, **self._on)
            for other in (*self._fixed, *(hull._body for hull in self.others))
        )

    def push(self, loads: Loads, state: BodyState) -> None:
        """Let the loads act in the next step, beginning at the vehicle's `state`."""
        thrust_n, torque_nm, air_n = loads.thrust_n, loads.torque_nm, loads.air_n
        r = state.rotation
        if (r[8] < _TIPPED_COS) != self._is_tipped:
            self._is_tipped = not self._is_tipped
            friction = self._frictions[self._is_tipped]
            pybullet.changeDynamics(self._body, -1, lateralFriction=friction, **self._on)
        pybullet.applyExternalForce(
            self._body,
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
        pybullet.applyExternalTorque(self._body, -1, torque_nm, pybullet.LINK_FRAME, self._id)

    def state(self) -> BodyState:
        """The vehicle's motion now."""
        position, orientation = pybullet.getBasePositionAndOrientation(self._body, self._id)
        velocity, rates = pybullet.getBaseVelocity(self._body, self._id)
        self.position_m = position
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
        even asked. The other vehicles' motion must have been looked at before.
        """
        vx, vy, vz = state.velocity_mps
        self._leash_m -= (abs(vx) + abs(vy) + abs(vz)) * self._step_s
        if not (self.others and self._is_crowded(state.position_m)):
            if self._leash_m > 0.0:
                return UNTOUCHED
            clearance_m = self._away_m(state.position_m) - self._reach_m
            if clearance_m > _MARGIN_M:
                self._leash_m = clearance_m
                return UNTOUCHED
        points = pybullet.getContactPoints(bodyA=self._body, **self._on)
        # Near misses are listed too; only what pushes back is touched.
        pressed = [point for point in points if point[9] > 0.0]
        touched = {point[2] for point in pressed}
        # The normals point to the vehicle.
        side = any(abs(point[7][2]) < _CARRIED_COS for point in pressed)
        return Touch(self._ground in touched, bool(touched - {self._ground}), side)

    def _is_crowded(self, position_m: Vector3) -> bool:
        """Whether another vehicle is so near that they may touch."""
        return any(
            math.dist(position_m, other.position_m) < self._reach_m + other._reach_m + _MARGIN_M
            for other in self.others
        )


def collision_shape(bodies: tuple[Body, ...], **on: int) -> int:
    """The number of bodies' common shape in the pybullet that `on` names."""
    return int(
        pybullet.createCollisionShapeArray(
            shapeTypes=[KINDS[body.shape] for body in bodies],
            halfExtents=[[side / 2.0 for side in body.size_m] for body in bodies],
            radii=[body.size_m[0] / 2.0 for body in bodies],
            lengths=[body.size_m[2] for body in bodies],
            collisionFramePositions=[body.position_m for body in bodies],
            collisionFrameOrientations=[body.orientation for body in bodies],
            **on,
        )
    )
