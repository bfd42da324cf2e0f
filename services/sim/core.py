"""The simulator, one step of physics at a time: commands in; messages and pictures to take out.

The same seed and the same commands at the same steps give the same messages.
"""

import math
from dataclasses import dataclass

import numpy as np

import worlds
from common import messages as m
from common.camera import DOWN, FRONT, Lens, Mount
from common.clock import NS_PER_S
from common.topics import TOPICS
from services.sim import sensors
from services.sim.config import PLANTS, Config
from services.sim.plant import BodyState, Quaternion, TumPlant, Vector3
from services.sim.stage import REST_HEIGHT_M, Scene, Stage
from services.sim.vehicle import StickNoise, Vehicle

PHYSICS_HZ = 600
"""A multiple of every sensor's rate (200, 100, 60, 30, 25 Hz), so that samples fall on steps."""
STEP_S = 1.0 / PHYSICS_HZ

MAX_COORDINATE_M = 1000.0
MAX_HEIGHT_M = 100.0
IN_THE_AIR_M = 0.1
"""A vehicle that starts this far above what is below it starts flying."""

VIDEO_TOPICS = ("camera/front", "camera/down")


@dataclass(frozen=True)
class Camera:
    """A camera of the vehicle.

    Attributes:
        topic: where its pictures go.
        lens: its size and projection.
        mount: its place in the body.
        fps: pictures a second.
        near_m: it sees nothing nearer; the nearer, the less it tells far things apart.
    """

    topic: str
    lens: Lens
    mount: Mount
    fps: float
    near_m: float = 0.08


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture to be taken: by which camera, when, and where the body is then."""

    topic: str
    stamp_ns: int
    position_m: Vector3
    orientation: Quaternion


@dataclass(frozen=True, slots=True)
class Step:
    """What one step brought: messages by topic, and pictures to take."""

    messages: tuple[tuple[str, m.Message], ...]
    shots: tuple[Shot, ...]


class ResetError(ValueError):
    """A reset that cannot be done; the text says what is allowed, `field` what is to blame."""

    def __init__(self, field: str, text: str) -> None:
        super().__init__(text)
        self.field = field


def cameras_of(config: Config) -> tuple[Camera, ...]:
    """The vehicle's cameras."""
    front = Lens.of_view(
        config.front_width, config.front_height, math.radians(config.front_view_deg)
    )
    down = Lens.of_view(config.down_width, config.down_height, math.radians(config.down_view_deg))
    return (
        Camera("camera/front", front, FRONT, config.front_fps),
        # On the ground it is 25 mm above it.
        Camera("camera/down", down, DOWN, config.down_fps, near_m=0.01),
    )


class _Schedule:
    """Which steps a rate falls on; `phase` shifts it by a part of its period."""

    def __init__(self, rate_hz: float, phase: float = 0.0) -> None:
        self._per_step = rate_hz / PHYSICS_HZ
        self._phase = phase

    def due(self, count: int) -> bool:
        now = math.floor(count * self._per_step + self._phase + 1e-9)
        return now > math.floor((count - 1) * self._per_step + self._phase + 1e-9)


def _rate_of(topic: str) -> float:
    rate_hz = TOPICS[topic].rate_hz
    assert rate_hz is not None
    return rate_hz


class Simulation:
    """One vehicle in one world.

    Args:
        config: how it starts.
        start_ns: the stamp of step 0; step n is stamped n / PHYSICS_HZ later.
    """

    def __init__(self, config: Config, start_ns: int = 0) -> None:
        self._config = config
        self._start_ns = start_ns
        self._count = 0
        self._told: tuple[str, int] | None = None
        self._imu_due = _Schedule(_rate_of("imu"))
        self._truth_due = _Schedule(_rate_of("truth"))
        self._altimeter_due = _Schedule(_rate_of("altimeter"))
        self._status_due = _Schedule(_rate_of("vehicle"))
        # Half a period apart, so that the two cameras do not ask for the renderer at once.
        self._cameras_due = tuple(
            (camera.topic, _Schedule(camera.fps, phase))
            for camera, phase in zip(cameras_of(config), (0.0, 0.5), strict=True)
        )
        self._world = worlds.load(config.world)
        self._seed = config.seed
        self._position_m = self._world.start_position_m
        self._yaw_rad = self._world.start_yaw_rad
        self._stage = Stage(self._world, STEP_S)
        self._restart()

    @property
    def now_ns(self) -> int:
        """The stamp of the last step."""
        return self._start_ns + self._count * NS_PER_S // PHYSICS_HZ

    @property
    def world(self) -> str:
        """Where the vehicle is."""
        return self._world.name

    @property
    def state(self) -> BodyState:
        """The vehicle's motion after the last step."""
        return self._state

    def scene(self) -> Scene:
        """What cameras see."""
        return self._stage.scene()

    def status(self) -> m.VehicleStatus:
        """The vehicle's own state."""
        return m.VehicleStatus(
            stamp=self.now_ns,
            seq=0,
            state=self._vehicle.state,
            battery=self._vehicle.battery,
            world=self._world.name,
            plant="tum",
            collisions=self._vehicle.collisions,
        )

    def step(self, command: m.Command | None = None) -> Step:
        """Move on by one step of physics.

        Args:
            command: what has arrived since the last step, if anything.
        """
        loads = self._vehicle.control(command, self._state, self._touch, self._below_m)
        self._stage.step(loads)
        self._count += 1
        self._look()

        count, now_ns, state = self._count, self.now_ns, self._state
        messages: list[tuple[str, m.Message]] = []
        if self._imu_due.due(count):
            messages.append(("imu", self._imu.sample(now_ns, state)))
        if self._truth_due.due(count):
            messages.append(("truth", sensors.truth(now_ns, state)))
        if self._altimeter_due.due(count):
            messages.append(("altimeter", self._altimeter.sample(now_ns, self._below_m)))
        news = (self._vehicle.state, self._vehicle.collisions)
        if news != self._told or self._status_due.due(count):
            self._told = news
            messages.append(("vehicle", self.status()))
        shots = tuple(
            Shot(topic, now_ns, state.position_m, state.orientation)
            for topic, schedule in self._cameras_due
            if schedule.due(count)
        )
        return Step(tuple(messages), shots)

    def reset(self, request: m.ResetRequest) -> m.VehicleStatus:
        """Start anew in place; stamps go on.

        What the request leaves out stays as it was last set; another world brings its own start.

        Raises:
            ResetError: if the request cannot be granted; then nothing has changed.
        """
        if request.plant is not None and request.plant not in PLANTS:
            raise ResetError("plant", f"no plant {request.plant!r}; there is {', '.join(PLANTS)}")
        position_m, yaw_rad = self._position_m, self._yaw_rad
        world = self._world
        if request.world is not None and request.world != world.name:
            try:
                world = worlds.load(request.world)
            except worlds.WorldError as error:
                raise ResetError("world", str(error)) from None
            position_m, yaw_rad = world.start_position_m, world.start_yaw_rad
        if request.position is not None:
            x, y, z = position_m = request.position
            if max(abs(x), abs(y)) > MAX_COORDINATE_M or not 0.0 <= z <= MAX_HEIGHT_M:
                raise ResetError(
                    "position",
                    f"x and y must lie within +-{MAX_COORDINATE_M:.0f} m,"
                    f" z within 0..{MAX_HEIGHT_M:.0f} m",
                )
        if request.yaw is not None:
            yaw_rad = math.remainder(request.yaw, 2.0 * math.pi)

        stage = self._stage if world is self._world else Stage(world, STEP_S)
        stage.place(_above_ground(position_m), yaw_rad)
        if stage.overlaps():
            if stage is self._stage:
                stage.restore(self._state)
            else:
                stage.close()
            raise ResetError("position", "something stands there; choose a free place")
        if stage is not self._stage:
            self._stage.close()
        self._stage, self._world = stage, world
        self._position_m, self._yaw_rad = position_m, yaw_rad
        self._seed = self._seed if request.seed is None else request.seed
        self._restart()
        return self.status()

    def close(self) -> None:
        """Leave pybullet."""
        self._stage.close()

    def _restart(self) -> None:
        command, imu, altimeter = (
            np.random.default_rng(child) for child in np.random.SeedSequence(self._seed).spawn(3)
        )
        self._stage.place(_above_ground(self._position_m), self._yaw_rad)
        scale = self._config.sensor_noise
        self._imu = sensors.Imu(imu, scale, 1.0 / _rate_of("imu"))
        self._altimeter = sensors.Altimeter(altimeter, scale)
        self._look()
        self._vehicle = Vehicle(
            TumPlant(STEP_S),
            StickNoise(command, self._config.command_noise, STEP_S),
            STEP_S,
            flying=self._below_m > REST_HEIGHT_M + IN_THE_AIR_M,
        )
        self._told = None

    def _look(self) -> None:
        self._state = self._stage.state()
        self._touch = self._stage.touch()
        self._below_m = self._stage.range_below(self._state, sensors.RANGE_MAX_M)


def _above_ground(position_m: Vector3) -> Vector3:
    x, y, z = position_m
    return (x, y, max(z, REST_HEIGHT_M))
