"""The vehicle: its states from landed to flying, the watchdog on commands, battery, collisions."""

import math

import numpy as np

from common.messages import Command, CommandAction, VehicleState
from common.topics import TOPICS
from services.sim.body import GRAVITY_MPS2, BodyState, Loads, Sticks, Vector3
from services.sim.hull import UNTOUCHED, Touch
from services.sim.plant import Plant

WATCHDOG_S = TOPICS["command"].max_age_s
"""A command older than this is worthless: the vehicle hovers."""

TAKE_OFF_HEIGHT_M = 0.5
"""Here a take-off is over (tum_simulator a020d89). It stops its rotors 0.2 m up or after 5 s of
landing; here they stop on touching down, since a real drone is not dropped."""
LANDED_HEIGHT_M = 0.2
"""What it touches while it lands, and is nearer than this below it, carries it."""
_OFF_ITS_FEET_M, _ON_ITS_FEET_M = 0.4, 0.1
"""Both heights are those of the body's origin; a tall vehicle's are so far above where it rests."""

CAPSIZED_COS = math.cos(1.4)
"""Tilted beyond 1.4 rad the rotors stop, as the real drone's do."""
STILL_MPS = 0.05
FALL_MPS = 1.0
"""To come down at this speed, as from 5 cm, is a crash; the drones land at half of it."""
COLLISION_GAP_S = 0.25
"""A contact is a new collision after this long without one: a scrape along a fence is one."""

BATTERY_LOW = 0.05
"""With less left it lands by itself and takes off no more; with nothing left the rotors stop."""

_NOISE_STEP_S = 0.02
_DRIFT_STEP_S = 5.0
_NEUTRAL = Sticks()


class StickNoise:
    """Noise on commands as tum_simulator's: uniform, and a drift redrawn every 5 s.

    The uniform part is redrawn at 50 Hz, the rate of commands.

    Args:
        generator: of the noise.
        noise: uniform within +-this.
        drift: the same.
        step_s: of physics.
    """

    def __init__(
        self, generator: np.random.Generator, noise: float, drift: float, step_s: float
    ) -> None:
        self._generator = generator
        self._limits = (noise, drift)
        self._every = round(_NOISE_STEP_S / step_s)
        self._blocks = round(_DRIFT_STEP_S / _NOISE_STEP_S)
        self._waiting: list[list[float]] = []
        self._count = 0
        self._offset = [0.0] * 4

    def add_to(self, sticks: Sticks) -> Sticks:
        """The sticks that the plant gets, one step later."""
        if self._limits == (0.0, 0.0):
            return sticks
        if self._count % self._every == 0:
            if not self._waiting:
                self._waiting = self._draw()
            self._offset = self._waiting.pop()
        self._count += 1
        vx, vy, vz, wz = self._offset
        return Sticks(sticks.vx + vx, sticks.vy + vy, sticks.vz + vz, sticks.wz + wz)

    def _draw(self) -> list[list[float]]:
        """The offsets of the next 5 s."""
        noise, drift = self._limits
        white = self._generator.uniform(-noise, noise, (self._blocks, 4))
        steady = self._generator.uniform(-drift, drift, 4)
        offsets: list[list[float]] = (white + steady).tolist()
        return offsets


class Vehicle:
    """Turns commands into loads, step by step: of what flies.

    Args:
        plant: how sticks become loads.
        noise: on the sticks while it flies.
        step_s: of physics.
        flying: whether it begins in the air.
        battery: what it begins with, 0..1.
        ceiling_m: above the world's ground; it climbs no higher.
    """

    def __init__(
        self,
        plant: Plant,
        noise: StickNoise,
        step_s: float,
        flying: bool,
        battery: float = 1.0,
        ceiling_m: float = 1000.0,
    ) -> None:
        self._plant = plant
        self._noise = noise
        self._step_s = step_s
        self._ceiling_m = ceiling_m
        self._weight_n = plant.build.mass_kg * GRAVITY_MPS2
        self._drain = step_s / plant.life_s
        rest_m = plant.build.rest_height_m
        self._up_m = max(TAKE_OFF_HEIGHT_M, rest_m + _OFF_ITS_FEET_M)
        self._down_m = max(LANDED_HEIGHT_M, rest_m + _ON_ITS_FEET_M)
        self._sticks = _NEUTRAL
        self._silence_s = 0.0
        self._apart_s = COLLISION_GAP_S
        self._sinking_mps = 0.0
        self._has_fallen = False
        self.state: VehicleState = "flying" if flying else "landed"
        self.collisions = 0
        self.has_news = True
        """Set when the state or the collisions change."""
        self.battery = battery
        """What is left, 0..1."""

    def control(
        self,
        command: Command | None,
        state: BodyState,
        touch: Touch,
        below_m: float,
        wind_mps: Vector3,
    ) -> Loads:
        """The loads of the next step.

        Args:
            command: what has arrived since the last step, if anything.
            state: the body's motion.
            touch: what it touches.
            below_m: the distance from the body's origin to what is below.
            wind_mps: of the air, world.
        """
        was = self.state
        # What it touches now it has met at the speed of the step before.
        self._has_fallen = self._sinking_mps > FALL_MPS
        self._sinking_mps = -state.velocity_mps[2]
        self._listen(command, state, touch)
        self._move_on(state, touch, below_m)
        now = self.state
        if touch is UNTOUCHED:
            self._apart_s += self._step_s
        else:
            self._count_collisions(touch)
        if now != was:
            self.has_news = True
        if now == "landed" or now == "emergency":
            self._plant.restart()
            return self._plant.fall(state, wind_mps, below_m)
        if now == "flying":
            sticks = self._noise.add_to(self._sticks)
            if sticks.vz > 0.0 and state.position_m[2] > self._ceiling_m:
                sticks = Sticks(sticks.vx, sticks.vy, 0.0, sticks.wz)
            loads = self._plant.fly(sticks, state, wind_mps, below_m)
        elif now == "taking_off":
            loads = self._plant.take_off(state, wind_mps, below_m)
        else:
            loads = self._plant.land(state, wind_mps, below_m)
        self._spend(loads)
        return loads

    def _spend(self, loads: Loads) -> None:
        # A rotor's power grows as thrust^1.5.
        share = max(0.0, loads.thrust_n) / self._weight_n
        self.battery = max(0.0, self.battery - self._drain * share * share**0.5)

    def _listen(self, command: Command | None, state: BodyState, touch: Touch) -> None:
        if command is None:
            self._silence_s += self._step_s
            if self._silence_s > WATCHDOG_S:
                self._sticks = _NEUTRAL
            return
        self._silence_s = 0.0
        self._sticks = Sticks(command.vx, command.vy, command.vz, command.wz)
        if command.action != "fly":
            self._obey(command.action, state, touch)

    def _obey(self, action: CommandAction, state: BodyState, touch: Touch) -> None:
        if action == "emergency":
            self.state = "emergency"
        elif action == "takeoff":
            if self.state == "landed" and state.tilt_rad < 0.5 and self.battery > BATTERY_LOW:
                self.state = "taking_off"
        elif self.state in ("taking_off", "flying"):
            self.state = "landing"
        elif self.state == "emergency" and lies_still(state, touch):
            self.state = "landed"

    def _move_on(self, state: BodyState, touch: Touch, below_m: float) -> None:
        now = self.state
        if now == "landed" or now == "emergency":
            return
        if state.rotation[8] < CAPSIZED_COS or self.battery == 0.0:
            self.state = "emergency"
        elif now == "landing":
            if (touch.ground or touch.body) and below_m < self._down_m:
                self.state = "landed"
        elif self.battery < BATTERY_LOW:
            self.state = "landing"
        elif now == "taking_off" and below_m >= self._up_m:
            self.state = "flying"

    def _count_collisions(self, touch: Touch) -> None:
        if not self._is_hit(touch):
            self._apart_s += self._step_s
            return
        if self._apart_s >= COLLISION_GAP_S:
            self.collisions += 1
            self.has_news = True
        self._apart_s = 0.0

    def _is_hit(self, touch: Touch) -> bool:
        is_up = self.state == "flying" or self._has_fallen
        return (touch.body and self.state != "landed") or (touch.ground and is_up)


def lies_still(state: BodyState, touch: Touch) -> bool:
    """Whether it is safe to touch: at rest, upright, on something."""
    speed = max(abs(each) for each in state.velocity_mps)
    return (touch.ground or touch.body) and speed < STILL_MPS and state.tilt_rad < 0.5
