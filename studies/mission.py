"""The figures of one mission, taken from what is on the bus (pure: messages in, figures out)."""

import math
from dataclasses import asdict, dataclass

import numpy as np

from common import messages as m
from common.clock import seconds
from studies.metrics import Array, LapCounter, hausdorff_m, path_length_m

LAP_MADE = 0.98
"""A lap counts when this much of it was made good: the start itself is crossed while landing."""
AIRBORNE_M = 0.5
THINNING_M = 0.02
"""Positions nearer to the last one than this are left out: sensor-rate jitter is not distance."""


@dataclass(frozen=True)
class Figures:
    """What a mission came to; the fields of `autocomplete demo --once --json`."""

    laps: int
    distance_m: float
    time_s: float
    suggestions: int
    accepted: int
    takeovers: int
    collisions: int
    hausdorff_m: float
    front_fps: float
    real_time_factor: float

    def as_dict(self) -> dict[str, int | float]:
        """Plain numbers, rounded to what they are good for."""
        return {
            key: value if isinstance(value, int) else round(value, 3)
            for key, value in asdict(self).items()
        }


class MissionRecord:
    """Gathers a mission's figures.

    Args:
        ideal_m: the world's ideal path, (N, 3).
    """

    def __init__(self, ideal_m: Array) -> None:
        self._ideal_m = ideal_m
        self._laps = LapCounter(ideal_m)
        self._flown_m: list[tuple[float, float, float]] = []
        self._first: tuple[int, int] | None = None
        self._last: tuple[int, int] | None = None
        self._takeoff_ns: int | None = None
        self._lap_end_ns: int | None = None
        self._pictures = 0
        self._pictures_ns: tuple[int, int] | None = None
        self._mode: m.FlightMode = "landed"
        self._flown = 0
        self.suggestions = 0
        self.accepted = 0
        self.takeovers = 0
        self.collisions = 0

    @property
    def laps(self) -> float:
        """Laps made good so far."""
        return self._laps.laps

    @property
    def mode(self) -> m.FlightMode:
        """The autopilot's mode as last heard."""
        return self._mode

    def on_truth(self, pose: m.Pose, arrival_ns: int) -> None:
        """Take a true pose."""
        if self._first is None:
            self._first = (pose.stamp, arrival_ns)
        self._last = (pose.stamp, arrival_ns)
        x_m, y_m, z_m = pose.position
        if z_m < AIRBORNE_M:
            return
        if self._takeoff_ns is None:
            self._takeoff_ns = pose.stamp
        made_before = self._laps.laps >= LAP_MADE
        self._laps.add(x_m, y_m)
        if not made_before:
            self._lap_end_ns = pose.stamp
            if not self._flown_m or math.dist(self._flown_m[-1], pose.position) >= THINNING_M:
                self._flown_m.append(pose.position)

    def on_suggestion(self, suggestion: m.Suggestion, arrival_ns: int) -> None:
        """Take a suggestion."""
        self.suggestions += 1

    def on_autopilot(self, status: m.AutopilotStatus, arrival_ns: int) -> None:
        """Take the autopilot's status: acceptances and take-overs are its changes of mode."""
        if status.mode == "engaged" and status.suggestion != self._flown:
            self.accepted += 1
        if self._mode == "engaged" and status.mode == "manual" and status.reason == "stick":
            self.takeovers += 1
        self._mode = status.mode
        self._flown = status.suggestion if status.mode == "engaged" else 0

    def on_vehicle(self, status: m.VehicleStatus, arrival_ns: int) -> None:
        """Take the vehicle's status."""
        self.collisions = status.collisions

    def on_front(self, image: m.Image, arrival_ns: int) -> None:
        """Take a front picture."""
        self._pictures += 1
        begin_ns = self._pictures_ns[0] if self._pictures_ns else arrival_ns
        self._pictures_ns = (begin_ns, arrival_ns)

    def figures(self) -> Figures:
        """The figures so far; times are the simulator's, the rate of pictures is the receiver's."""
        flown = np.asarray(self._flown_m, dtype=float).reshape(-1, 3)
        time_s = 0.0
        if self._takeoff_ns is not None and self._lap_end_ns is not None:
            time_s = seconds(self._lap_end_ns - self._takeoff_ns)
        factor = fps = 0.0
        if self._first and self._last and self._last[1] > self._first[1]:
            factor = (self._last[0] - self._first[0]) / (self._last[1] - self._first[1])
        if self._pictures_ns and self._pictures > 1:
            fps = (self._pictures - 1) / seconds(self._pictures_ns[1] - self._pictures_ns[0])
        return Figures(
            laps=math.floor(self._laps.laps + 1.0 - LAP_MADE),
            distance_m=path_length_m(flown),
            time_s=time_s,
            suggestions=self.suggestions,
            accepted=self.accepted,
            takeovers=self.takeovers,
            collisions=self.collisions,
            hausdorff_m=hausdorff_m(flown[:, :2], self._ideal_m[:, :2]) if len(flown) > 1 else 0.0,
            front_fps=fps,
            real_time_factor=factor,
        )
