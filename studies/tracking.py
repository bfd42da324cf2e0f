"""How closely a path is flown: one flight along an ideal path, through the simulator in lock-step.

A helmsman takes off, climbs and keeps his place by hand, lets go and accepts a path that begins
where the vehicle takes itself to be. From then on every true position is held against that path.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from common import messages as m
from common.frames import yaw_of
from services.autopilot.config import Config as AutopilotConfig
from services.autopilot.control import Controller, Reference
from services.autopilot.core import Autopilot, Follow
from services.autopilot.follower import Follower
from services.localizer.config import Config as LocalizerConfig
from services.localizer.core import Localizer
from services.operator.person import Decision
from services.operator.sources import Deflection
from services.sim.config import Config as SimConfig
from services.sim.core import Simulation
from studies.darkroom import Darkroom
from studies.lockstep import Lockstep
from studies.metrics import Array, resample

STEP_M = 0.05
SPEED_MPS = 1.0
HEIGHT_M = 1.2
RADIUS_M = 2.0
SETTLED_M = 0.1
SETTLED_MPS = 0.15
START_LIMIT_S = 25.0
FLIGHT_LIMIT_S = 100.0
"""By then 15 m are flown at 0.15 m/s, the slowest that the autopilot plans."""
RATE_HZ = 50
PICTURES_HZ = 30.0
"""As many as the localizer looks at."""

Points = list[tuple[float, float, float, float]]


def _along(points_m: Array) -> Points:
    """Points (N, 3) with yaw along the level part of their tangents."""
    slopes = np.gradient(points_m, axis=0)
    yaws = np.unwrap(np.arctan2(slopes[:, 1], slopes[:, 0]))
    return [(x, y, z, yaw) for (x, y, z), yaw in zip(points_m.tolist(), yaws.tolist(), strict=True)]


def line(length_m: float = 15.0) -> Points:
    """Straight ahead from the origin."""
    x = np.arange(0.0, length_m, STEP_M)
    return _along(np.column_stack([x, np.zeros((len(x), 2))]))


def arc(turns: float = 1.0, pitch_m: float = 0.0) -> Points:
    """To the left from the origin, on a circle of 2 m; with a pitch it climbs."""
    angle = np.arange(0.0, 2.0 * math.pi * turns, STEP_M / RADIUS_M)
    return _along(
        np.column_stack(
            [
                RADIUS_M * np.sin(angle),
                RADIUS_M * (1.0 - np.cos(angle)),
                pitch_m * angle / (2.0 * math.pi),
            ]
        )
    )


def sine(amplitude_m: float = 1.0, wavelength_m: float = 6.0, waves: float = 2.5) -> Points:
    """Straight ahead from the origin on average, beginning along its slope."""
    x = np.arange(0.0, waves * wavelength_m, STEP_M)
    y = amplitude_m * np.sin(2.0 * math.pi * x / wavelength_m)
    return _along(np.column_stack([x, y, np.zeros(len(x))]))


PATHS: dict[str, tuple[Callable[[], Points], bool, float]] = {
    "line": (line, False, 1.0),
    "arc": (arc, True, 2.0),
    "helix": (lambda: arc(turns=2.0, pitch_m=0.6), False, 1.0),
    "sine": (sine, False, 1.0),
}
"""By primitive: the path at the origin, whether it is closed, and how often it is flown."""

HOVER = "hover"
"""The name of a case that flies no path but keeps the place at the end of a short line."""
KEPT_S = 30.0
SETTLING_S = 3.0


@dataclass(frozen=True)
class Case:
    """What is flown, in what.

    Attributes:
        primitive: a name of `PATHS`, or `HOVER`.
        plant: of the vehicle.
        wind_mps: from a direction drawn by the seed.
        gusts: whether the wind gusts.
        seed: of noise, heading and wind's direction.
        seen: whether poses are the localizer's, with pictures; else the truth.
    """

    primitive: str
    plant: m.Plant = "tum"
    wind_mps: float = 0.0
    gusts: bool = False
    seed: int = 0
    seen: bool = False


@dataclass(frozen=True)
class Flight:
    """What came of it.

    Attributes:
        reason: why it ended; `flown` if all of the path was.
        cross_track_m: true distances to the path, 50 a second.
        speed_mps: mean, along the path.
        path_m: (N, 3); the place kept in a hover.
        flown_m: true places, (M, 3).
    """

    reason: str
    cross_track_m: Array
    speed_mps: float
    path_m: Array
    flown_m: Array

    @property
    def is_complete(self) -> bool:
        """Whether all of the path was flown."""
        return self.reason == "flown"

    @property
    def rmse_m(self) -> float:
        """Root of the mean squared distance to the path."""
        return float(np.sqrt(np.mean(self.cross_track_m**2)))


class _Helmsman:
    """Takes off and keeps a place by hand, by what he sees (the truth), until he lets go."""

    def __init__(self, plant: m.Plant, yaw_rad: float) -> None:
        self._controller = Controller(plant, AutopilotConfig())
        self._place = Reference((0.0, 0.0, HEIGHT_M), yaw_rad)
        self._pose: m.Pose | None = None
        self._flies = False
        self._asked = False
        self.lets_go = False
        self.is_ready = False

    def truth(self, pose: m.Pose, _now_ns: int) -> None:
        self._pose = pose

    def vehicle(self, status: m.VehicleStatus, now_ns: int) -> None:
        self._flies = status.state == "flying"

    def command(self, command: m.Command, _now_ns: int) -> None:
        if self._pose is not None and self._flies:
            self._controller.observe(self._pose, command, 1.0 / RATE_HZ)

    def step(self, now_ns: int) -> tuple[Deflection, Decision | None]:
        if not self._asked and now_ns > 1_000_000_000:
            self._asked = True
            return Deflection(), Decision("takeoff")
        pose = self._pose
        if pose is None or not self._flies or self.lets_go:
            return Deflection(), None
        sticks = self._controller.sticks(pose, 0.0, self._place, 1.0 / RATE_HZ)
        self.is_ready = (
            math.dist(pose.position, self._place.position_m) < SETTLED_M
            and math.hypot(*pose.velocity) < SETTLED_MPS
        )
        return Deflection(sticks.vx, sticks.vy, sticks.vz, sticks.wz), None

    def answered(self, action: m.DecideAction, ok: bool) -> None:
        pass


def fly(case: Case, follow: Follow = Follower) -> Flight:
    """Fly a case.

    Args:
        case: what.
        follow: what flies an accepted path.

    Raises:
        RuntimeError: if the start was not reached or the path not accepted.
    """
    rng = np.random.default_rng(case.seed)
    heading_rad, wind_from_deg = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, 360.0)
    settings = SimConfig(
        world="empty",
        plant=case.plant,
        seed=case.seed,
        wind_mps=case.wind_mps,
        wind_from_deg=wind_from_deg,
        gusts=case.gusts,
        renderer="auto" if case.seen else "none",
        down_fps=PICTURES_HZ,
    )
    simulation = Simulation(settings)
    darkroom = Darkroom(simulation, settings) if case.seen else None
    config = AutopilotConfig(max_height_m=20.0)
    helmsman = _Helmsman(case.plant, heading_rad)
    chain = Lockstep(
        simulation,
        helmsman,
        autopilot=Autopilot(config, 0, follow),
        localizer=Localizer(LocalizerConfig()) if case.seen else None,
        darkroom=darkroom,
    )
    try:
        return _fly(case, chain, helmsman, heading_rad)
    finally:
        simulation.close()
        if darkroom is not None:
            darkroom.close()


def _fly(case: Case, chain: Lockstep, helmsman: _Helmsman, heading_rad: float) -> Flight:
    poses: list[m.Pose] = []
    statuses: list[m.AutopilotStatus] = []
    truths: list[m.Pose] = []
    chain.listen("truth", helmsman.truth)
    chain.listen("vehicle", helmsman.vehicle)
    chain.listen("command", helmsman.command)
    chain.listen("pose", lambda pose, _: poses.append(pose))
    chain.listen("truth", lambda pose, _: truths.append(pose))
    chain.listen("autopilot", lambda status, _: statuses.append(status))
    if not chain.run_until(lambda: helmsman.is_ready, START_LIMIT_S):
        raise RuntimeError(f"{case}: the start was not reached")
    helmsman.lets_go = True
    chain.run(2.0 / RATE_HZ)
    make, closed, laps = PATHS.get(case.primitive, (lambda: line(1.0), False, 1.0))
    points = _placed(make(), poses[-1].position, yaw_of(poses[-1].orientation))
    chain.say("suggestion", _suggestion(case.primitive, points, closed, chain.now_ns))
    reply = chain.decide("accept")
    if not reply.ok:
        raise RuntimeError(f"{case}: not accepted: {reply.reason}")
    path_m = np.array(points)[:, :3]
    around_m = np.vstack([path_m, path_m[:1]]) if closed else path_m
    whole_m = laps * float(np.linalg.norm(np.diff(around_m, axis=0), axis=1).sum())
    truths.clear()
    begin_ns, first = chain.now_ns, len(statuses)
    chain.run_until(
        lambda: statuses[-1].mode != "engaged" or (closed and statuses[-1].progress > whole_m),
        FLIGHT_LIMIT_S,
    )
    last = statuses[-1]
    if last.mode == "engaged":
        reason = "flown" if closed and last.progress > whole_m else "too slow"
    else:
        reason = "flown" if last.reason == "finished" else last.reason
    if case.primitive == HOVER:
        chain.run(SETTLING_S)
        around_m = path_m = np.array([truths[-1].position])
        truths.clear()
        chain.run(KEPT_S)
    flown_along_m = max((status.progress for status in statuses[first:]), default=0.0)
    flown_m = np.array([pose.position for pose in truths])[::2]
    return Flight(
        reason,
        np.asarray(cKDTree(resample(around_m, 0.01)).query(flown_m)[0]),
        flown_along_m / ((chain.now_ns - begin_ns) * 1e-9),
        path_m,
        flown_m,
    )


def _placed(points: Points, position_m: tuple[float, float, float], yaw_rad: float) -> Points:
    """A path at the origin, moved to the vehicle so that it begins along its nose."""
    turn = yaw_rad - points[0][3]
    cos, sin = math.cos(turn), math.sin(turn)
    x0, y0, z0 = position_m
    return [
        (
            x0 + cos * x - sin * y,
            y0 + sin * x + cos * y,
            z0 + z,
            math.remainder(yaw + turn, 2.0 * math.pi),
        )
        for x, y, z, yaw in points
    ]


def _suggestion(primitive: str, points: Points, closed: bool, now_ns: int) -> m.Suggestion:
    return m.Suggestion(
        stamp=now_ns,
        seq=0,
        id=1,
        primitive=primitive,
        params={},
        path=points,
        closed=closed,
        speed=SPEED_MPS,
        fit_rms=0.0,
        confidence=1.0,
        heading_sector=0,
    )
