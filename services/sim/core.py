"""The simulator, one step of physics at a time: commands in; messages and pictures to take out.

The same seed and the same commands at the same steps give the same messages.
"""

import math
from collections.abc import Sequence
from reprlib import repr as repr_of

import worlds
from common import messages as m
from services.sim import plants
from services.sim.actor import PHYSICS_HZ, STEP_NS, STEP_S, Actor, Step
from services.sim.body import BodyState, Vector3
from services.sim.build import Build
from services.sim.cameras import Camera, cameras_of
from services.sim.config import Config
from services.sim.crew import crew_of
from services.sim.hull import Hull
from services.sim.stage import Scene, Stage
from worlds import MAX_COORDINATE_M, MAX_HEIGHT_M, World

__all__ = ["PHYSICS_HZ", "STEP_NS", "STEP_S", "ResetError", "Simulation", "Step"]

APART_M = 1.0
"""Between the vehicles' start places."""
_ROOM_M = 0.2
"""What is left free around a start place."""
_ABREAST = (0.0, 1.0, -1.0)
"""Start places of a row, to the left of its middle: no more than a lane is wide."""
_ROWS = 50


class ResetError(ValueError):
    """A reset that cannot be done; the text says what is allowed, `field` what is to blame."""

    def __init__(self, field: str, text: str) -> None:
        super().__init__(text)
        self.field = field


class Simulation:
    """Vehicles in one world, most often one.

    Args:
        config: how they start.
        start_ns: the stamp of step 0; step n is stamped n / PHYSICS_HZ later.
    """

    def __init__(self, config: Config, start_ns: int = 0) -> None:
        self._config = config
        self.actors = [
            Actor(config, index, member.plant, start_ns)
            for index, member in enumerate(crew_of(config.vehicles, config.plant))
        ]
        for actor in self.actors:
            actor.others = [other for other in self.actors if other is not actor]
        self._first = self.actors[0]
        self._world = worlds.load(config.world)
        self._stage = Stage(self._world, STEP_S)
        for actor in self.actors:
            hull = self._stage.add(actor.plant.build)
            try:
                start = _start_place(self._world, hull, actor)
            except ResetError:
                self.close()
                raise
            actor.enter(self._stage, self._world.name, hull, *start)
        for actor in self.actors:
            actor.restart()

    @property
    def now_ns(self) -> int:
        """The stamp of the last step."""
        return self._first.now_ns

    @property
    def world(self) -> str:
        """Where the vehicles are."""
        return self._world.name

    @property
    def state(self) -> BodyState:
        """The first vehicle's motion after the last step."""
        return self._first.state

    def worlds(self) -> list[str]:
        """The worlds that a reset may ask for: those that are shipped, and its own."""
        return sorted({*worlds.names(), self._config.world})

    def scene(self) -> Scene:
        """What cameras see, besides vehicles."""
        return self._stage.scene()

    def cameras(self) -> list[Camera]:
        """Those of all vehicles."""
        return [
            camera
            for actor in self.actors
            for camera in cameras_of(self._config, actor.index, actor.plant.build)
        ]

    def status(self) -> m.VehicleStatus:
        """The first vehicle's own state."""
        return self._first.status()

    def step(self, command: m.Command | None = None) -> Step:
        """Move on by one step of physics; what the first vehicle says.

        Args:
            command: what has arrived for the first vehicle since the last step, if anything.
        """
        if len(self.actors) > 1:
            return self.step_all([command, *[None] * (len(self.actors) - 1)])[0]
        first = self._first
        first.act(command)
        self._stage.step()
        first.move()
        return first.perceive()

    def step_all(self, commands: Sequence[m.Command | None]) -> list[Step]:
        """The same for all vehicles: a command, or none, and what came of it for each."""
        for actor, command in zip(self.actors, commands, strict=True):
            actor.act(command)
        self._stage.step()
        for actor in self.actors:
            actor.move()
        return [actor.perceive() for actor in self.actors]

    def reset(self, request: m.ResetRequest, index: int = 0) -> m.VehicleStatus:
        """Start a vehicle anew in place; stamps go on.

        What the request leaves out stays as it was last set. Another world is one for all
        vehicles: each begins at its start place there.

        Args:
            request: what is to be changed.
            index: of the vehicle.

        Raises:
            ResetError: if the request cannot be granted; then nothing has changed.
        """
        actor = self.actors[index]
        plant = actor.plant_name if request.plant is None else request.plant
        try:
            build = plants.load(plant).build
        except ValueError as error:
            raise ResetError("plant", str(error)) from None
        if request.position is not None:
            _check(request.position)
        if request.world is None or request.world == self._world.name:
            self._put(actor, build, request)
            restarting = [actor]
        else:
            self._move_all(request.world, actor, build, request)
            restarting = self.actors
        actor.become(plant, request.seed)
        for each in restarting:
            each.restart()
        return actor.status()

    def _put(self, actor: Actor, build: Build, request: m.ResetRequest) -> None:
        """Give a vehicle a body and a place in the present world."""
        stage, before = self._stage, actor.plant.build
        place = _asked(request, actor.position_m, actor.yaw_rad)
        hull = actor.hull if build == before else stage.replace(actor.hull, build)
        hull.place(*place)
        if hull.overlaps():
            actor.hull = hull if build == before else stage.replace(hull, before)
            actor.hull.restore(actor.state)
            raise _OCCUPIED
        actor.enter(stage, self._world.name, hull, *place)

    def _move_all(
        self, world_name: str, asked: Actor, build: Build, request: m.ResetRequest
    ) -> None:
        """Give every vehicle a body and a place in another world."""
        if world_name not in self.worlds():
            # Files of this machine are named by who starts it, not by who asks.
            known = ", ".join(self.worlds())
            raise ResetError("world", f"no world {repr_of(world_name)}; there are {known}")
        try:
            world = worlds.load(world_name)
        except worlds.WorldError as error:
            raise ResetError("world", str(error)) from None
        stage = Stage(world, STEP_S)
        cast = []
        try:
            for actor in self.actors:
                hull = stage.add(build if actor is asked else actor.plant.build)
                if actor is asked and request.position is not None:
                    place = _asked(request, world.start_position_m, world.start_yaw_rad)
                else:
                    place = _start_place(world, hull, actor)
                    place = _asked(request, *place) if actor is asked else place
                hull.place(*place)
                if hull.overlaps():
                    raise _OCCUPIED
                cast.append((hull, place))
        except ResetError:
            stage.close()
            raise
        for actor, (hull, place) in zip(self.actors, cast, strict=True):
            actor.enter(stage, world.name, hull, *place)
        self._stage.close()
        self._stage, self._world = stage, world

    def close(self) -> None:
        """Leave pybullet."""
        self._stage.close()


_OCCUPIED = ResetError("position", "something stands there; choose a free place")


def _check(position_m: Vector3) -> None:
    x, y, z = position_m
    if max(abs(x), abs(y)) > MAX_COORDINATE_M or not 0.0 <= z <= MAX_HEIGHT_M:
        raise ResetError(
            "position",
            f"x and y must lie within +-{MAX_COORDINATE_M:.0f} m, z within 0..{MAX_HEIGHT_M:.0f} m",
        )


def _asked(request: m.ResetRequest, position_m: Vector3, yaw_rad: float) -> tuple[Vector3, float]:
    """Where a request puts a vehicle that otherwise would be here."""
    if request.position is not None:
        position_m = request.position
    if request.yaw is not None:
        yaw_rad = math.remainder(request.yaw, 2.0 * math.pi)
    return position_m, yaw_rad


def _start_place(world: World, hull: Hull, actor: Actor) -> tuple[Vector3, float]:
    """Where a vehicle begins: the first as the world says, others beside and behind it.

    The hull is put there. Those before it are at their places already.

    Raises:
        ResetError: if there is no room for it.
    """
    (x, y, z), yaw_rad = world.start_position_m, world.start_yaw_rad
    if actor.index == 0:
        hull.place((x, y, z), yaw_rad)
        if hull.overlaps():
            raise ResetError(
                "world",
                f"{world.name}: something stands where it starts;"
                " move that, or its `start`, or ask for another position",
            )
        return (x, y, z), yaw_rad
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    for row in range(_ROWS):
        for column in _ABREAST:
            back, left = -APART_M * row, APART_M * column
            place = (x + cos * back - sin * left, y + sin * back + cos * left, z)
            hull.place(place, yaw_rad)
            if not hull.overlaps(_ROOM_M):
                return place, yaw_rad
    raise ResetError("world", f"{world.name} has no room for so many vehicles")
