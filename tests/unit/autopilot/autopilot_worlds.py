"""Hand-made messages, paths and a vehicle for the autopilot's tests."""

import math
import random
from dataclasses import dataclass, field

import numpy as np

from common import messages as m
from common.frames import quaternion_of, wrap_angle
from services.autopilot.config import Config
from services.autopilot.core import Autopilot

Point = tuple[float, float, float, float]
PERIOD_S = 0.02


def stick(seq: int, vx: float = 0.0, vy: float = 0.0, vz: float = 0.0, wz: float = 0.0) -> m.Stick:
    return m.Stick(stamp=0, seq=seq, vx=vx, vy=vy, vz=vz, wz=wz)


def pose(
    seq: int,
    position: tuple[float, float, float] = (0.0, 0.0, 1.0),
    yaw: float = 0.0,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw_rate: float = 0.0,
    status: m.PoseStatus = "ok",
) -> m.Pose:
    return m.Pose(
        stamp=0,
        seq=seq,
        position=position,
        orientation=quaternion_of(0.0, 0.0, yaw),
        velocity=velocity,
        angular_velocity=(0.0, 0.0, yaw_rate),
        covariance=(0.0,) * 6,
        status=status,
        source="test",
    )


def vehicle(state: m.VehicleState, plant: m.Plant = "tum", battery: float = 1.0) -> m.VehicleStatus:
    return m.VehicleStatus(
        stamp=0, seq=0, state=state, battery=battery, world="empty", plant=plant, collisions=0
    )


def suggestion(
    path: list[Point], closed: bool = False, speed: float = 0.9, id_: int = 1
) -> m.Suggestion:
    return m.Suggestion(
        stamp=0,
        seq=0,
        id=id_,
        primitive="line",
        params={},
        path=path,
        closed=closed,
        speed=speed,
        fit_rms=0.0,
        confidence=1.0,
        heading_sector=0,
    )


def line(length_m: float = 20.0, yaw: float = 0.0, z: float = 1.0) -> list[Point]:
    count = round(length_m / 0.1) + 1
    return [(0.1 * i * math.cos(yaw), 0.1 * i * math.sin(yaw), z, yaw) for i in range(count)]


def circle(radius_m: float, turn: int = 1, pitch_m: float = 0.0, turns: int = 1) -> list[Point]:
    """From the origin, first along +x, counter-clockwise for turn = 1."""
    count = round(2.0 * math.pi * radius_m * turns / 0.1) + 1
    angles = np.linspace(0.0, 2.0 * math.pi * turns, count)
    return [
        (
            radius_m * math.sin(a),
            turn * radius_m * (1.0 - math.cos(a)),
            1.0 + pitch_m * a / (2.0 * math.pi),
            wrap_angle(turn * a),
        )
        for a in angles
    ]


def sine(amplitude_m: float = 1.0, wavelength_m: float = 6.0, waves: int = 3) -> list[Point]:
    wave = 2.0 * math.pi / wavelength_m
    return [
        (
            x,
            amplitude_m * math.sin(wave * x),
            1.0,
            math.atan(amplitude_m * wave * math.cos(wave * x)),
        )
        for x in np.arange(0.0, waves * wavelength_m, 0.07).tolist()
    ]


@dataclass
class LaggingVehicle:
    """Speeds follow sticks by first-order lags, as the `tum` plant's do roughly.

    `noise` scales tum_simulator's: each command +-0.05, and a drift of +-0.03 drawn every 5 s.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 1.0
    yaw: float = 0.0
    noise: float = 0.0
    wind_mps: tuple[float, float] = (0.0, 0.0)
    seed: int = 0
    velocity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    yaw_rate: float = 0.0
    _time_s: float = 0.0
    _drift: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def fly(self, command: m.Command, duration_s: float = PERIOD_S, steps: int = 4) -> None:
        for _ in range(steps):
            self._step(command, duration_s / steps)

    def _step(self, command: m.Command, dt_s: float) -> None:
        if not self._drift or self._time_s >= 5.0:
            self._drift = [self.noise * self._random.uniform(-0.03, 0.03) for _ in range(4)]
            self._time_s = 0.0
        self._time_s += dt_s
        vx, vy, vz, wz = (
            value + drift + self.noise * self._random.uniform(-0.05, 0.05)
            for value, drift in zip(
                (command.vx, command.vy, command.vz, command.wz), self._drift, strict=True
            )
        )
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        goals = (
            cos * vx - sin * vy + self.wind_mps[0],
            sin * vx + cos * vy + self.wind_mps[1],
            0.5 * vz,
        )
        for axis, (goal, lag_s) in enumerate(zip(goals, (0.4, 0.4, 0.4), strict=True)):
            self.velocity[axis] += dt_s * (goal - self.velocity[axis]) / lag_s
        self.yaw_rate += dt_s * (wz - self.yaw_rate) / 0.5
        self.x += dt_s * self.velocity[0]
        self.y += dt_s * self.velocity[1]
        self.z += dt_s * self.velocity[2]
        self.yaw += dt_s * self.yaw_rate

    def pose(self, seq: int) -> m.Pose:
        vx, vy, vz = self.velocity
        return pose(seq, (self.x, self.y, self.z), self.yaw, (vx, vy, vz), self.yaw_rate)


class Rig:
    """An autopilot with neutral sticks, poses and a flying vehicle, 50 times a second."""

    def __init__(self, body: LaggingVehicle | None = None, config: Config | None = None) -> None:
        self.now_ns = 1_000_000_000
        self.autopilot = Autopilot(config or Config(), self.now_ns)
        self.body = body or LaggingVehicle()
        self.sticks = True
        self.poses = True
        self.command = m.Command(
            stamp=0, seq=0, vx=0.0, vy=0.0, vz=0.0, wz=0.0, action="fly", mode="hover"
        )
        self.status: m.AutopilotStatus | None = None
        self._seq = 0
        self._nonce = 0
        self.autopilot.on_vehicle(vehicle("flying"), self.now_ns)
        self.run(0.1)

    def tick(self) -> None:
        """One period: pose, stick, step, then the vehicle moves."""
        self._seq += 1
        self.now_ns += round(PERIOD_S * 1e9)
        if self.poses:
            self.autopilot.on_pose(self.body.pose(self._seq), self.now_ns)
        if self.sticks:
            self.take(self.autopilot.on_stick(stick(self._seq), self.now_ns, self.now_ns))
        self.take(self.autopilot.step(self.now_ns, self.now_ns))
        self.body.fly(self.command)

    def take(self, output) -> None:  # type: ignore[no-untyped-def]
        self.command = output.command or self.command
        self.status = output.status or self.status

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / PERIOD_S)):
            self.tick()

    def deflect(self, **axes: float) -> None:
        """One deflected stick, right now."""
        self._seq += 1
        self.take(self.autopilot.on_stick(stick(self._seq, **axes), self.now_ns, self.now_ns))

    def decide(self, action: m.DecideAction, **more: int) -> m.DecideReply:
        self._nonce += 1
        request = m.DecideRequest(action=action, **{"nonce": self._nonce, **more})
        reply = self.autopilot.decide(request, self.now_ns)
        self.take(self.autopilot.settle(self.now_ns, self.now_ns))
        return reply

    def suggest(self, message: m.Suggestion) -> None:
        self.autopilot.on_suggestion(message, self.now_ns)

    def engage(self, path: list[Point], closed: bool = False, speed: float = 0.9) -> None:
        self.suggest(suggestion(path, closed, speed))
        reply = self.decide("accept", suggestion=1)
        assert reply == m.DecideReply(ok=True, reason="accepted", mode="engaged"), reply

    @property
    def velocity_command(self) -> tuple[float, float, float, float]:
        return self.command.vx, self.command.vy, self.command.vz, self.command.wz
