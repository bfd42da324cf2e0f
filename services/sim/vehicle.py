"""The vehicle: its states from landed to flying, the watchdog on commands, noise, collisions."""

import numpy as np

from common.messages import Command, VehicleState
from common.topics import TOPICS
from services.sim.plant import NO_LOADS, BodyState, Loads, Sticks, TumPlant
from services.sim.stage import Touch, tilt_of

WATCHDOG_S = TOPICS["command"].max_age_s
"""A command older than this is worthless: the vehicle hovers."""

# Take-off and landing of tum_simulator a020d89. It stops its rotors 0.2 m up or after 5 s of
# landing; here they stop on touching down, since a real drone is not dropped.
TAKE_OFF_LIFT = 1.5
TAKE_OFF_HEIGHT_M = 0.5
LANDING_LIFT = 0.8

CAPSIZED_RAD = 1.4
"""Tilted beyond this the rotors stop, as the real drone's do."""
STILL_MPS = 0.05
COLLISION_GAP_S = 0.25
"""A contact is a new collision after this long without one: a scrape along a fence is one."""
BATTERY_LIFE_S = 12 * 60.0
"""Of flight."""

_NOISE_STEP_S = 0.02
_NOISE = 0.05
_DRIFT_STEP_S = 5.0
_DRIFT = 0.03


class StickNoise:
    """tum_simulator's noise on commands: uniform +-0.05, and a drift +-0.03 redrawn every 5 s.

    The uniform part is redrawn at 50 Hz, the rate of commands.
    """

    def __init__(self, generator: np.random.Generator, scale: float, step_s: float) -> None:
        self._generator = generator
        self._scale = scale
        self._every = round(_NOISE_STEP_S / step_s)
        self._drift_every = round(_DRIFT_STEP_S / step_s)
        self._count = 0
        self._noise = self._drift = [0.0] * 4

    def add_to(self, sticks: Sticks) -> Sticks:
        """The sticks that the plant gets, one step later."""
        if self._scale == 0.0:
            return sticks
        if self._count % self._drift_every == 0:
            self._drift = self._draw(_DRIFT)
        if self._count % self._every == 0:
            self._noise = self._draw(_NOISE)
        self._count += 1
        noise, drift = self._noise, self._drift
        return Sticks(
            sticks.vx + noise[0] + drift[0],
            sticks.vy + noise[1] + drift[1],
            sticks.vz + noise[2] + drift[2],
            sticks.wz + noise[3] + drift[3],
        )

    def _draw(self, amplitude: float) -> list[float]:
        limit = amplitude * self._scale
        return [float(each) for each in self._generator.uniform(-limit, limit, 4)]


class Vehicle:
    """Turns commands into loads, step by step.

    Args:
        plant: how sticks become loads.
        noise: on the sticks while it flies.
        step_s: of physics.
        flying: whether it begins in the air.
    """

    def __init__(self, plant: TumPlant, noise: StickNoise, step_s: float, flying: bool) -> None:
        self._plant = plant
        self._noise = noise
        self._step_s = step_s
        self._sticks = Sticks()
        self._silence_s = 0.0
        self._apart_s = COLLISION_GAP_S
        self._flight_s = 0.0
        self.state: VehicleState = "flying" if flying else "landed"
        self.collisions = 0

    @property
    def battery(self) -> float:
        """What is left, 0..1."""
        return max(0.0, 1.0 - self._flight_s / BATTERY_LIFE_S)

    def control(
        self, command: Command | None, state: BodyState, touch: Touch, below_m: float
    ) -> Loads:
        """The loads of the next step.

        Args:
            command: what has arrived since the last step, if anything.
            state: the body's motion.
            touch: what it touches.
            below_m: the distance from the body's origin to what is below.
        """
        self._listen(command, state, touch)
        self._move_on(state, touch, below_m)
        self._count_collisions(touch)
        if self.state in ("landed", "emergency"):
            self._plant.restart()
            return NO_LOADS
        self._flight_s += self._step_s
        if self.state == "taking_off":
            return self._plant.loads(Sticks(), state, TAKE_OFF_LIFT)
        if self.state == "landing":
            return self._plant.loads(Sticks(), state, LANDING_LIFT)
        return self._plant.loads(self._noise.add_to(self._sticks), state)

    def _listen(self, command: Command | None, state: BodyState, touch: Touch) -> None:
        if command is None:
            self._silence_s += self._step_s
            if self._silence_s > WATCHDOG_S:
                self._sticks = Sticks()
            return
        self._silence_s = 0.0
        self._sticks = Sticks(command.vx, command.vy, command.vz, command.wz)
        if command.action == "emergency":
            self.state = "emergency"
        elif command.action == "takeoff" and self.state == "landed" and _upright(state):
            self.state = "taking_off"
        elif command.action == "land":
            if self.state in ("taking_off", "flying"):
                self.state = "landing"
            elif self.state == "emergency" and _lies_still(state, touch):
                self.state = "landed"

    def _move_on(self, state: BodyState, touch: Touch, below_m: float) -> None:
        if self.state in ("taking_off", "flying", "landing") and tilt_of(state) > CAPSIZED_RAD:
            self.state = "emergency"
        elif self.state == "taking_off" and below_m >= TAKE_OFF_HEIGHT_M:
            self.state = "flying"
        elif self.state == "landing" and (touch.ground or touch.body) and below_m < 0.2:
            self.state = "landed"

    def _count_collisions(self, touch: Touch) -> None:
        hit = (touch.body and self.state != "landed") or (touch.ground and self.state == "flying")
        if not hit:
            self._apart_s += self._step_s
            return
        if self._apart_s >= COLLISION_GAP_S:
            self.collisions += 1
        self._apart_s = 0.0


def _upright(state: BodyState) -> bool:
    return tilt_of(state) < 0.5


def _lies_still(state: BodyState, touch: Touch) -> bool:
    speed = max(abs(each) for each in state.velocity_mps)
    return (touch.ground or touch.body) and speed < STILL_MPS and _upright(state)
