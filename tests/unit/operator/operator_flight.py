"""A vehicle, an autopilot and suggestions in a few lines, for flights in lock step."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from common.frames import quaternion_of
from common.messages import (
    AutopilotStatus,
    FlightMode,
    FullStickSpeeds,
    Pose,
    Suggestion,
    VehicleStatus,
)
from services.operator.person import Decision, Person
from services.operator.pilot import Pilot
from services.operator.route import Route
from services.operator.sources import Deflection

STEP_S = 0.02
LAG_S = 0.4
YAW_LAG_S = 0.1
GRAVITY = 9.81


@dataclass
class Vehicle:
    """Follows stick velocities in the heading frame with a first-order lag; tilts to accelerate."""

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_rad: float = 0.0
    velocity_mps: np.ndarray = field(default_factory=lambda: np.zeros(3))
    yaw_rate_radps: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    state: str = "landed"

    def step(self, forward: float, left: float, up: float, turn: float) -> None:
        if self.state == "taking_off":
            self.z_m += 0.5 * STEP_S
            if self.z_m > 0.5:
                self.state = "flying"
            return
        if self.state == "landing":
            self.z_m -= 0.5 * STEP_S
            if self.z_m <= 0.0:
                self.state = "landed"
            return
        if self.state == "landed":
            return
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        wanted = np.array([cos * forward - sin * left, sin * forward + cos * left, up])
        acceleration = (wanted - self.velocity_mps) / LAG_S
        self.velocity_mps = self.velocity_mps + acceleration * STEP_S
        self.yaw_rate_radps += (turn - self.yaw_rate_radps) * STEP_S / YAW_LAG_S
        self.yaw_rad += self.yaw_rate_radps * STEP_S
        self.pitch_rad = math.atan((cos * acceleration[0] + sin * acceleration[1]) / GRAVITY)
        self.roll_rad = -math.atan((-sin * acceleration[0] + cos * acceleration[1]) / GRAVITY)
        self.x_m += float(self.velocity_mps[0]) * STEP_S
        self.y_m += float(self.velocity_mps[1]) * STEP_S
        self.z_m += float(self.velocity_mps[2]) * STEP_S

    def pose(self, stamp: int) -> Pose:
        orientation = quaternion_of(self.roll_rad, self.pitch_rad, self.yaw_rad)
        return Pose(
            stamp=stamp,
            seq=0,
            position=(self.x_m, self.y_m, self.z_m),
            orientation=orientation,
            velocity=tuple(float(v) for v in self.velocity_mps),
            angular_velocity=(0.0, 0.0, self.yaw_rate_radps),
            covariance=(0.0,) * 6,
            status="ok",
            source="test",
        )


Offer = Callable[["Flight"], Suggestion | None]
"""Called once a second while the sticks are deflected, as a suggestion would come."""


class Flight:
    """A pilot, a vehicle, and an autopilot that follows accepted paths exactly enough."""

    def __init__(self, route: Route, person: Person, offer: Offer | None = None) -> None:
        self.route = route
        self.pilot = Pilot(route, person, STEP_S)
        self.vehicle = Vehicle()
        self.offer = offer
        self.now_ns = 0
        self.track: list[tuple[float, float, float]] = []
        self.sticks: list[Deflection] = []
        self.decisions: list[tuple[float, Decision]] = []
        self.engaged: list[tuple[int, str]] = []
        self.refusals = 0
        self.full_stick: FullStickSpeeds | None = None
        self.hovers = False
        """Set by a gap in the sticks; the autopilot obeys again once they were neutral."""
        self._offered: dict[int, Suggestion] = {}
        self._following: Suggestion | None = None
        self._deflected_s = 0.0

    @property
    def time_s(self) -> float:
        return self.now_ns / 1e9

    @property
    def is_engaged(self) -> bool:
        return self._following is not None

    def run(self, limit_s: float, until: Callable[["Flight"], bool] | None = None) -> None:
        while self.time_s < limit_s and not self.pilot.is_over:
            self.step()
            if until is not None and until(self):
                return

    def step(self) -> None:
        self.now_ns += round(STEP_S * 1e9)
        ticks = round(self.now_ns / (STEP_S * 1e9))
        self.pilot.truth(self.vehicle.pose(self.now_ns), self.now_ns)
        if ticks % 5 == 0:
            self.pilot.autopilot(
                AutopilotStatus(
                    stamp=self.now_ns,
                    seq=0,
                    mode=self._mode(),
                    suggestion=self._following.id if self._following else 0,
                    progress=0.0,
                    cross_track=0.0,
                    reason="",
                ),
                self.now_ns,
            )
            self.pilot.vehicle(
                VehicleStatus(
                    stamp=self.now_ns,
                    seq=0,
                    state=self.vehicle.state,
                    battery=1.0,
                    world="track",
                    plant="tum",
                    collisions=0,
                    full_stick=self.full_stick,
                ),
                self.now_ns,
            )
        sticks, decision = self.pilot.step(self.now_ns)
        self.sticks.append(sticks)
        if decision is not None:
            self.decisions.append((self.time_s, decision))
            self._decide(decision, sticks)
        if not sticks.is_neutral:
            self._following = None
        self._deflected_s = 0.0 if sticks.is_neutral else self._deflected_s + STEP_S
        if self.offer is not None and self._deflected_s > 1.5 and ticks % 50 == 0:
            suggestion = self.offer(self)
            if suggestion is not None:
                self._offered[suggestion.id] = suggestion
                self.pilot.suggestion(suggestion, self.now_ns)
        self.hovers = self.hovers and not sticks.is_neutral
        if self.hovers:
            self.vehicle.step(0.0, 0.0, 0.0, 0.0)
        elif self._following is not None:
            self.vehicle.step(*self._follow(self._following))
        else:
            self.vehicle.step(sticks.vx, sticks.vy, 0.5 * sticks.vz, sticks.wz)
        if self.vehicle.state == "flying":
            self.track.append((self.vehicle.x_m, self.vehicle.y_m, self.vehicle.z_m))

    def _mode(self) -> FlightMode:
        if self.hovers:
            return "hover"
        return "engaged" if self.is_engaged else "manual"

    def _decide(self, decision: Decision, sticks: Deflection) -> None:
        ok = True
        if decision.action == "takeoff":
            self.vehicle.state = "taking_off"
        elif decision.action == "land":
            self.vehicle.state = "landing"
        elif decision.action == "cancel":
            self._following = None
        elif decision.action == "accept":
            ok = sticks.is_neutral and decision.suggestion in self._offered
            if ok:
                self._following = self._offered[decision.suggestion]
                self.engaged.append((self._following.id, self._following.primitive))
            else:
                self.refusals += 1
        self.pilot.answered(decision.action, ok)

    def _follow(self, suggestion: Suggestion) -> tuple[float, float, float, float]:
        path = np.array(suggestion.path)
        here = np.array([self.vehicle.x_m, self.vehicle.y_m])
        nearest = int(np.argmin(np.linalg.norm(path[:, :2] - here, axis=1)))
        target = path[
            (nearest + 8) % len(path) if suggestion.closed else min(nearest + 8, len(path) - 1)
        ]
        direction = target[:2] - here
        distance = float(np.linalg.norm(direction))
        speed = suggestion.speed if distance > 0.1 else 0.0
        east, north = speed * direction / max(distance, 1e-6)
        cos, sin = math.cos(self.vehicle.yaw_rad), math.sin(self.vehicle.yaw_rad)
        turn = math.remainder(path[nearest, 3] - self.vehicle.yaw_rad, 2.0 * math.pi)
        return (
            cos * east + sin * north,
            -sin * east + cos * north,
            0.8 * (path[nearest, 2] - self.vehicle.z_m),
            max(-1.0, min(1.0, 1.5 * turn)),
        )

    def offsets_m(self) -> np.ndarray:
        """Distances of the flown track to the route, (N,)."""
        track = np.array(self.track)[:, :2]
        return np.min(
            np.linalg.norm(track[:, None] - self.route.points_m[None, :, :2], axis=2), axis=1
        )
