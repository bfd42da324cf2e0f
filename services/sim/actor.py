"""One vehicle on the stage: commands in; messages and pictures to take out."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from common import messages as m
from common.clock import NS_PER_S
from common.topics import TOPICS
from services.sim import plants, sensors
from services.sim.body import CALM, BodyState, Quaternion, Vector3
from services.sim.build import Build
from services.sim.cameras import Figure, Shot, cameras_of
from services.sim.config import Config
from services.sim.delay import Delay
from services.sim.driving import Driven
from services.sim.hull import Hull, Touch
from services.sim.stage import Stage
from services.sim.vehicle import StickNoise, Vehicle
from services.sim.wind import STEP_S as WIND_STEP_S
from services.sim.wind import Wind

PHYSICS_HZ = 200
"""The rate of the IMU, and a multiple of the other instruments'; pictures may fall between steps.
The fastest loop of a plant has 20 ms, and is integrated as the step responses in the tests say."""
STEP_S = 1.0 / PHYSICS_HZ
STEP_NS = NS_PER_S // PHYSICS_HZ

IN_THE_AIR_M = 0.05
"""A vehicle that starts this far above what is below it starts flying."""


class Step(msgspec.Struct, frozen=True, gc=False):
    """What one step brought: messages by topic, and pictures to take."""

    messages: Sequence[tuple[str, m.Message]]
    shots: Sequence[Shot]


class _Shutter:
    """When a camera takes pictures: `fps` a second, the first after `phase` of a period."""

    def __init__(self, index: int, topic: str, fps: float, phase: float) -> None:
        self.index = index
        self.topic = topic
        self._period_steps = PHYSICS_HZ / fps
        self._phase = phase
        self.taken = 0
        self.next_step = self._at()

    def released(self) -> None:
        """The picture of `next_step` is taken."""
        self.taken += 1
        self.next_step = self._at()

    def _at(self) -> float:
        # Rounded, so that a picture meant for a step does not miss it by a last bit.
        return round((self.taken + 1 - self._phase) * self._period_steps, 9)


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
_NO_ONE: tuple[Figure, ...] = ()


def _shutters_of(config: Config, build: Build) -> list[_Shutter]:
    # Half a period apart, so that the two cameras do not ask for the renderer at once.
    return [
        _Shutter(index, camera.topic, camera.fps, 0.5 * index)
        for index, camera in enumerate(cameras_of(config))
        if config.renderer != "none" and camera.topic in build.sensors
    ]


class Actor:
    """A vehicle, its instruments and its links. It has to `enter` a stage.

    Args:
        config: how it starts.
        index: its place among the vehicles, 0 for the first; each has noise of its own.
        plant: the name of what it is.
        start_ns: the stamp of step 0; step n is stamped n / PHYSICS_HZ later.
    """

    state: BodyState
    """Its motion after the last step."""
    hull: Hull
    _stage: Stage
    _vehicle: Vehicle
    _touch: Touch
    _below_m: float
    _air_mps: Vector3

    def __init__(self, config: Config, index: int, plant: str, start_ns: int) -> None:
        self._config = config
        self.index = index
        self._start_ns = start_ns
        self._count = 0
        self._seed = config.seed
        self.plant_name = plant
        self.plant = plants.load(plant)
        self.others: Sequence[Actor] = ()

    @property
    def now_ns(self) -> int:
        """The stamp of the last step."""
        return self._start_ns + self._count * STEP_NS

    def enter(
        self, stage: Stage, world: str, hull: Hull, position_m: Vector3, yaw_rad: float
    ) -> None:
        """Begin there at the next `restart`."""
        self._stage, self.world, self.hull = stage, world, hull
        self.position_m, self.yaw_rad = position_m, yaw_rad

    def become(self, plant: str, seed: int | None) -> None:
        """Be this at the next `restart`, with noise of that seed."""
        self.plant_name, self.plant = plant, plants.load(plant)
        self._seed = self._seed if seed is None else seed

    def status(self) -> m.VehicleStatus:
        """The vehicle's own state."""
        return m.VehicleStatus(
            stamp=self.now_ns,
            seq=0,
            state=self._vehicle.state,
            battery=self._vehicle.battery,
            world=self.world,
            plant=self.plant_name,
            collisions=self._vehicle.collisions,
            full_stick=self.plant.full_stick,
            rates=self.plant.rates,
        )

    def act(self, command: m.Command | None) -> None:
        """Push the body for the next step.

        Args:
            command: what has arrived since the last step, if anything.
        """
        if self._command_link is not None:
            command = self._command_link.step(command)
        was = self.state
        if self._wind is not None and self._count % _WIND_EVERY == 0:
            self._air_mps = self._wind.step(was.position_m, was.velocity_mps)
        loads = self._vehicle.control(command, was, self._touch, self._below_m, self._air_mps)
        self.hull.push(loads, was)

    def move(self) -> None:
        """See where the step has led."""
        self._count += 1
        self._was = self.state
        self.state = self.hull.state()

    def perceive(self) -> Step:
        """What the instruments say now; every vehicle has moved."""
        count, state, vehicle = self._count, self.state, self._vehicle
        self._touch = self.hull.touch(state)
        now_ns = self._start_ns + count * STEP_NS
        told: list[tuple[str, m.Message]] = []
        if self._has_imu:
            told.append(("imu", self._imu.sample(now_ns, state)))
        if count % _ALTIMETER_EVERY == 0:
            range_m = self._look_down()
            if self._has_altimeter:
                told.append(("altimeter", self._altimeter.sample(now_ns, range_m)))
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
        shots = [self._shot(shutter) for shutter in self._shutters if shutter.next_step <= count]
        return Step(told, self._video_link.step(shots))

    def restart(self) -> None:
        """Start anew at its place, everything but the stamps."""
        config = self._config
        # All rates begin anew, so that a seed is the same flight whenever it begins.
        self._start_ns, self._count = self.now_ns, 0
        # The first vehicle's noise is that of the seed alone, however many there are.
        command, imu, altimeter, gusts = (
            np.random.default_rng(child)
            for child in np.random.SeedSequence([self._seed, self.index]).spawn(4)
        )
        build = self.plant.build
        self.hull.place(self.position_m, self.yaw_rad)
        self._has_imu, self._has_altimeter = "imu" in build.sensors, "altimeter" in build.sensors
        self._shutters = _shutters_of(config, build)
        self._imu = sensors.Imu(imu, config.sensor_noise, STEP_S)
        self._altimeter = sensors.Altimeter(altimeter, config.sensor_noise)
        self._wind = (
            Wind(gusts, config.wind_mps, config.wind_from_deg, config.gusts)
            if config.wind_mps > 0.0
            else None
        )
        self._air_mps = CALM
        self.state = self.hull.state()
        self._touch = self.hull.touch(self.state)
        self._look_down()
        scale = config.command_noise
        self._vehicle = (Vehicle if self.plant.flies else Driven)(
            self.plant(STEP_S),
            StickNoise(command, scale * self.plant.noise, scale * self.plant.drift, STEP_S),
            STEP_S,
            flying=not self.plant.flies or self._below_m > build.rest_height_m + IN_THE_AIR_M,
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

    def figure(self) -> Figure:
        """What others see of it."""
        return Figure(self.plant.build.look, self.state.position_m, self.state.orientation)

    def _look_down(self) -> float:
        """What the altimeter would measure; notes what is right below."""
        state = self.state
        ranges_m = self._stage.ranges(
            self.hull, state.position_m, sensors.cone(state), sensors.RANGE_MAX_M
        )
        self._below_m = ranges_m[0]
        return min(ranges_m)

    def _shot(self, shutter: _Shutter) -> Shot:
        """The picture that fell into the last step."""
        was, now, share = self._was, self.state, shutter.next_step - (self._count - 1)
        stamp_ns = self._start_ns + int(shutter.next_step * STEP_NS)
        seed = (self._seed, self.index, shutter.index, shutter.taken)
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
            self.index,
            tuple(other.figure() for other in self.others) if self.others else _NO_ONE,
            seed,
        )


def _steps(duration_s: float) -> int:
    return round(duration_s * PHYSICS_HZ)


def quaternion_between(begin: Quaternion, end: Quaternion, share: float) -> Quaternion:
    """The turn at a share of the way between two that are close together."""
    (x0, y0, z0, w0), (x1, y1, z1, w1) = begin, end
    near = share if x0 * x1 + y0 * y1 + z0 * z1 + w0 * w1 >= 0.0 else -share
    left = 1.0 - share
    x, y = left * x0 + near * x1, left * y0 + near * y1
    z, w = left * z0 + near * z1, left * w0 + near * w1
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return (x / norm, y / norm, z / norm, w / norm)
