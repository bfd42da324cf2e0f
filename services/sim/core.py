"""The simulator, one step of physics at a time: commands in; messages and pictures to take out.

The same seed and the same commands at the same steps give the same messages.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

import worlds
from common import messages as m
from common.clock import NS_PER_S
from common.topics import TOPICS
from services.sim import sensors
from services.sim.body import CALM, REST_HEIGHT_M, BodyState, Quaternion, Vector3
from services.sim.cameras import Shot, cameras_of
from services.sim.config import Config
from services.sim.delay import Delay
from services.sim.plants import PLANTS
from services.sim.stage import Scene, Stage, Touch
from services.sim.vehicle import StickNoise, Vehicle
from services.sim.wind import STEP_S as WIND_STEP_S
from services.sim.wind import Wind

PHYSICS_HZ = 200
"""The rate of the IMU, and a multiple of the other instruments'; pictures may fall between steps.
The fastest loop of a plant has 20 ms, and is integrated as the step responses in the tests say."""
STEP_S = 1.0 / PHYSICS_HZ
STEP_NS = NS_PER_S // PHYSICS_HZ

MAX_COORDINATE_M = 1000.0
MAX_HEIGHT_M = 100.0
IN_THE_AIR_M = 0.1
"""A vehicle that starts this far above what is below it starts flying."""


class Step(msgspec.Struct, frozen=True, gc=False):
    """What one step brought: messages by topic, and pictures to take."""

    messages: Sequence[tuple[str, m.Message]]
    shots: Sequence[Shot]


class ResetError(ValueError):
    """A reset that cannot be done; the text says what is allowed, `field` what is to blame."""

    def __init__(self, field: str, text: str) -> None:
        super().__init__(text)
        self.field = field


class _Shutter:
    """When a camera takes pictures: `fps` a second, the first after `phase` of a period."""

    def __init__(self, topic: str, fps: float, phase: float) -> None:
        self.topic = topic
        self._period_steps = PHYSICS_HZ / fps
        self._phase = phase
        self._taken = 0
        self.next_step = self._at()

    def released(self) -> None:
        """The picture of `next_step` is taken."""
        self._taken += 1
        self.next_step = self._at()

    def _at(self) -> float:
        # Rounded, so that a picture meant for a step does not miss it by a last bit.
        return round((self._taken + 1 - self._phase) * self._period_steps, 9)


def _every(topic: str) -> int:
    """The steps from one message of an instrument to its next."""
    rate_hz = TOPICS[topic].rate_hz
    assert rate_hz is not None
    steps = PHYSICS_HZ / rate_hz
    assert steps == int(steps)
    return int(steps)


_TRUTH_EVERY = _every("truth")
_ALTIMETER_EVERY = _every("altimeter")
_STATUS_EVERY = _every("vehicle")
_WIND_EVERY = round(WIND_STEP_S * PHYSICS_HZ)


class Simulation:
    """One vehicle in one world.

    Args:
        config: how it starts.
        start_ns: the stamp of step 0; step n is stamped n / PHYSICS_HZ later.
    """

    _vehicle: Vehicle
    _state: BodyState
    _touch: Touch
    _below_m: float
    _air_mps: Vector3

    def __init__(self, config: Config, start_ns: int = 0) -> None:
        self._config = config
        self._start_ns = start_ns
        self._count = 0
        # Half a period apart, so that the two cameras do not ask for the renderer at once.
        self._shutters = [
            _Shutter(camera.topic, camera.fps, phase)
            for camera, phase in zip(cameras_of(config), (0.0, 0.5), strict=True)
            if config.renderer != "none"
        ]
        self._world = worlds.load(config.world)
        self._plant: m.Plant = config.plant
        self._seed = config.seed
        self._position_m = self._world.start_position_m
        self._yaw_rad = self._world.start_yaw_rad
        self._stage = Stage(self._world, STEP_S)
        self._restart()

    @property
    def now_ns(self) -> int:
        """The stamp of the last step."""
        return self._start_ns + self._count * STEP_NS

    @property
    def world(self) -> str:
        """Where the vehicle is."""
        return self._world.name

    @property
    def state(self) -> BodyState:
        """The vehicle's motion after the last step."""
        return self._state

    def worlds(self) -> list[str]:
        """The worlds that a reset may ask for: those that are shipped, and its own."""
        return sorted({*worlds.names(), self._config.world})

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
            plant=self._plant,
            collisions=self._vehicle.collisions,
        )

    def step(self, command: m.Command | None = None) -> Step:
        """Move on by one step of physics.

        Args:
            command: what has arrived since the last step, if anything.
        """
        count = self._count
        if self._command_link is not None:
            command = self._command_link.step(command)
        if self._wind is not None and count % _WIND_EVERY == 0:
            self._air_mps = self._wind.step(self._state.position_m, self._state.velocity_mps)
        was, vehicle = self._state, self._vehicle
        loads = vehicle.control(command, was, self._touch, self._below_m, self._air_mps)
        self._stage.step(loads, was)
        self._count = count = count + 1
        self._state = state = self._stage.state()
        self._touch = self._stage.touch(state)

        now_ns = self._start_ns + count * STEP_NS
        told: list[tuple[str, m.Message]] = [("imu", self._imu.sample(now_ns, state))]
        if count % _ALTIMETER_EVERY == 0:
            told.append(("altimeter", self._altimeter.sample(now_ns, self._look_down())))
        elif vehicle.state != "flying":
            self._look_down()
        if vehicle.has_news or count % _STATUS_EVERY == 0:
            vehicle.has_news = False
            told.append(("vehicle", self.status()))
        if self._sensor_link is not None:
            told = self._sensor_link.step(told)
        if count % _TRUTH_EVERY == 0:
            told.append(("truth", sensors.truth(now_ns, state)))
        if not self._shutters:
            return Step(told, ())
        shots = [
            self._shot(shutter, was) for shutter in self._shutters if shutter.next_step <= count
        ]
        return Step(told, self._video_link.step(shots))

    def reset(self, request: m.ResetRequest) -> m.VehicleStatus:
        """Start anew in place; stamps go on.

        What the request leaves out stays as it was last set; another world brings its own start.

        Raises:
            ResetError: if the request cannot be granted; then nothing has changed.
        """
        plant = self._plant
        if request.plant is not None:
            if request.plant not in PLANTS:
                raise ResetError(
                    "plant", f"no plant {request.plant!r}; there are {', '.join(PLANTS)}"
                )
            plant = PLANTS[request.plant].name
        position_m, yaw_rad = self._position_m, self._yaw_rad
        world = self._world
        if request.world is not None and request.world != world.name:
            if request.world not in self.worlds():
                # Files of this machine are named by who starts it, not by who asks.
                known = ", ".join(self.worlds())
                raise ResetError("world", f"no world {request.world!r}; there are {known}")
            world = worlds.load(request.world)
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
        self._plant = plant
        self._position_m, self._yaw_rad = position_m, yaw_rad
        self._seed = self._seed if request.seed is None else request.seed
        self._restart()
        return self.status()

    def close(self) -> None:
        """Leave pybullet."""
        self._stage.close()

    def _restart(self) -> None:
        config = self._config
        command, imu, altimeter, gusts = (
            np.random.default_rng(child) for child in np.random.SeedSequence(self._seed).spawn(4)
        )
        self._stage.place(_above_ground(self._position_m), self._yaw_rad)
        self._imu = sensors.Imu(imu, config.sensor_noise, STEP_S)
        self._altimeter = sensors.Altimeter(altimeter, config.sensor_noise)
        self._wind = (
            Wind(gusts, config.wind_mps, config.wind_from_deg, config.gusts)
            if config.wind_mps > 0.0
            else None
        )
        self._air_mps = CALM
        self._state = self._stage.state()
        self._touch = self._stage.touch(self._state)
        self._look_down()
        plant = PLANTS[self._plant]
        scale = config.command_noise
        self._vehicle = Vehicle(
            plant(STEP_S),
            StickNoise(command, scale * plant.noise, scale * plant.drift, STEP_S),
            STEP_S,
            flying=self._below_m > REST_HEIGHT_M + IN_THE_AIR_M,
            battery=config.battery,
            ceiling_m=config.ceiling_m,
        )
        self._command_link: Delay[m.Command | None] | None = None
        self._sensor_link: Delay[list[tuple[str, m.Message]]] | None = None
        if config.command_delay_s > 0.0:
            self._command_link = Delay(_steps(config.command_delay_s), lambda: None)
        if config.sensor_delay_s > 0.0:
            self._sensor_link = Delay(_steps(config.sensor_delay_s), list)
        self._video_link: Delay[list[Shot]] = Delay(_steps(config.video_delay_s), list)

    def _look_down(self) -> float:
        """What the altimeter would measure; notes what is right below."""
        ranges_m = self._stage.ranges(
            self._state.position_m, sensors.cone(self._state), sensors.RANGE_MAX_M
        )
        self._below_m = ranges_m[0]
        return min(ranges_m)

    def _shot(self, shutter: _Shutter, was: BodyState) -> Shot:
        """The picture that fell into the step that led from `was` to the present state."""
        now, share = self._state, shutter.next_step - (self._count - 1)
        stamp_ns = self._start_ns + int(shutter.next_step * STEP_NS)
        shutter.released()
        # Within a step the body moves on at a constant velocity.
        (x0, y0, z0), (x1, y1, z1) = was.position_m, now.position_m
        left = 1.0 - share
        position_m = (left * x0 + share * x1, left * y0 + share * y1, left * z0 + share * z1)
        turn = quaternion_between(was.orientation, now.orientation, share)
        return Shot(
            shutter.topic,
            stamp_ns,
            position_m,
            turn,
            now.velocity_mps,
            now.angular_velocity_radps,
        )


def _steps(duration_s: float) -> int:
    return round(duration_s * PHYSICS_HZ)


def _above_ground(position_m: Vector3) -> Vector3:
    x, y, z = position_m
    return (x, y, max(z, REST_HEIGHT_M))


def quaternion_between(begin: Quaternion, end: Quaternion, share: float) -> Quaternion:
    """The turn at a share of the way between two that are close together."""
    (x0, y0, z0, w0), (x1, y1, z1, w1) = begin, end
    near = share if x0 * x1 + y0 * y1 + z0 * z1 + w0 * w1 >= 0.0 else -share
    left = 1.0 - share
    x, y = left * x0 + near * x1, left * y0 + near * y1
    z, w = left * z0 + near * z1, left * w0 + near * w1
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return (x / norm, y / norm, z / norm, w / norm)
