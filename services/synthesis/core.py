"""From an intent and the poses of its window to a suggestion, or to the reason for none."""

import math
from dataclasses import dataclass

import numpy as np

import worlds
from common.clock import seconds
from common.frames import Array, yaw_of
from common.messages import (
    NONE_LABEL,
    FitRequest,
    Intent,
    Pose,
    Refusal,
    Suggestion,
    VehicleStatus,
)
from common.topics import TOPICS
from services.synthesis.config import Config
from services.synthesis.continuation import Vehicle, continue_from, heading_sector
from services.synthesis.extension import extended_shape
from services.synthesis.fitting import check, fit, inflation, newest_motion, trust
from services.synthesis.history import CELL_M, History, Track
from services.synthesis.meaning import Running, same
from services.synthesis.primitives import EXTENDED, PRIMITIVES
from services.synthesis.primitives.shape import Shape, UnfitError
from services.synthesis.surroundings import Surroundings, Way

POSE_MAX_AGE_S = TOPICS["pose"].max_age_s
MAX_POINTS = 400
"""More points of a request than this are averaged in groups of neighbours."""
MAX_COORDINATE_M = 1e5
SIMPLER_CONFIDENCE = 0.5
"""Factor on the confidence when geometry says something simpler than the intent."""
MAX_REASON = 200


class RefusalError(Exception):
    """There is nothing to suggest; the text says why, `field` which part of a request is to blame.

    A normal answer, not a failure.
    """

    def __init__(self, reason: str, field: str | None = None) -> None:
        super().__init__(reason)
        self.field = field


@dataclass(frozen=True)
class Offer:
    """A shape that may be suggested.

    Attributes:
        shape: what is meant.
        confidence: that it is, before the fit's own doubts.
        note: why it is not what the intent says; empty if it is.
    """

    shape: Shape
    confidence: float
    note: str = ""


class Synthesizer:
    """Holds the pose history and the running suggestion, and counts suggestions."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._known = PRIMITIVES | (EXTENDED if config.primitives == "extended" else {})
        self._history = History()
        self._surroundings = Surroundings(config, bodies=None)
        self._world: str | None = None
        self._running: Running | None = None
        self._last_id = 0
        self.last_refusal: str | None = None
        """Why the newest intent led to no suggestion; None if it did, or there was none."""
        self.world_trouble: str | None = None
        """Why nothing is known of what stands in the vehicle's world; None if it is."""

    def on_pose(self, pose: Pose, arrival_ns: int) -> None:
        """Remember where the vehicle is."""
        self._history.add(pose, arrival_ns)

    def on_vehicle(self, vehicle: VehicleStatus) -> None:
        """Look up what stands in the world that the vehicle says it is in."""
        if vehicle.world == self._world:
            return
        self._world = vehicle.world
        self._surroundings = Surroundings(self._config, bodies=None)
        self.world_trouble = None
        try:
            bodies = worlds.load(vehicle.world).bodies
        except worlds.WorldError as error:
            self.world_trouble = f"walls are not known: {error}"
        else:
            self._surroundings = Surroundings(self._config, bodies)

    def on_intent(self, intent: Intent, arrival_ns: int) -> Suggestion | Refusal | None:
        """A suggestion, or why there is none; None if nothing is meant."""
        try:
            suggestion = self._suggest(intent, arrival_ns)
        except RefusalError as refusal:
            self.last_refusal = str(refusal)
            if intent.label == NONE_LABEL:
                return None
            return Refusal(
                stamp=intent.stamp, seq=0, label=intent.label, reason=_short(str(refusal))
            )
        self.last_refusal = None
        return suggestion

    def pose_trouble(self, now_ns: int) -> str | None:
        """Why the poses cannot be used now, or None."""
        newest = self._history.newest
        if newest is None:
            return "no pose has come yet"
        age_s = seconds(now_ns - newest[0])
        if age_s > POSE_MAX_AGE_S:
            return f"the newest pose is {age_s:.1f} s old"
        if newest[1].status == "lost":
            return "the pose is lost"
        return None

    def fit(self, request: FitRequest, stamp: int, now_ns: int) -> Suggestion:
        """The suggestion that continues the request's points from the last one on.

        Nobody can accept it, so it may lead through walls.

        Args:
            request: a primitive, and points whose errors are independent.
            stamp: of the suggestion, ns.
            now_ns: the receiver's monotonic time; a fresh pose tells where the body's x points, by
                which `heading_sector` is counted, else it is world x.

        Raises:
            RefusalError: if the points do not determine such a primitive.
        """
        if request.primitive not in self._known:
            known = ", ".join(self._known)
            raise RefusalError(
                f"primitive {request.primitive!r} is unknown; known are {known}", "primitive"
            )
        points = np.array(request.points, dtype=np.float64)
        if np.abs(points).max() > MAX_COORDINATE_M:
            raise RefusalError(f"points lie beyond {MAX_COORDINATE_M:.0f} m", "points")
        here = points[-1]
        if len(points) > MAX_POINTS:
            points = np.array(
                [group.mean(axis=0) for group in np.array_split(points, MAX_POINTS, axis=0)]
            )
        try:
            shape = fit(self._known[request.primitive], points, here)
            check(shape, self._config, inflation=1.0)
            path = continue_from(shape, Vehicle(here, yaw_rad=None))
        except UnfitError as unfit:
            raise RefusalError(f"{request.primitive}: {unfit}", "points") from None
        asked_mps = request.speed or self._config.cruise_mps
        speed_mps = self._limited(asked_mps)
        self._last_id += 1
        return _suggestion(
            self._last_id,
            shape,
            Way(path, shape.closed),
            stamp=stamp,
            speed_mps=speed_mps,
            confidence=trust(shape, self._config, inflation=1.0),
            yaw_rad=self._present_yaw_rad(now_ns),
            inflation=1.0,
            note="" if speed_mps == asked_mps else f"speed {asked_mps:g} becomes {speed_mps:g} m/s",
        )

    def _suggest(self, intent: Intent, arrival_ns: int) -> Suggestion:
        """A suggestion, or RefusalError with the reason for none."""
        if intent.label == NONE_LABEL:
            raise RefusalError("the operator's intent is none")
        if intent.label not in PRIMITIVES:
            raise RefusalError(f"the intent is {intent.label!r}, which cannot be synthesised")
        trouble = self.pose_trouble(arrival_ns)
        newest = self._history.newest
        if trouble is not None or newest is None:
            raise RefusalError(trouble or "no pose has come yet")
        begin_ns = arrival_ns - (intent.window_end - intent.window_start)
        track = self._history.track(begin_ns, arrival_ns)
        if track is None or len(track.points_m) * CELL_M < self._config.min_extent_m:
            moved_m = 0.0 if track is None else (len(track.points_m) - 1) * CELL_M
            raise RefusalError(f"{intent.label}: the vehicle moved only {moved_m:.1f} m")
        if self._history.is_held(begin_ns, arrival_ns):
            raise RefusalError(f"{intent.label}: the vehicle is still where it was held")
        if self._running is not None and not self._running.lasts(arrival_ns):
            self._running = None

        vehicle = Vehicle(track.here_m, track.yaw_rad, track.velocity_mps)
        offer, path = self._extended(intent, vehicle, arrival_ns) or self._offer(
            intent, track, vehicle
        )
        shape = offer.shape
        position_std_m = math.sqrt(max(newest[1].covariance[0], newest[1].covariance[1]))
        try:
            way = self._surroundings.keep(path, shape.closed, position_std_m)
        except UnfitError as unfit:
            raise RefusalError(f"{shape.name} withheld: {unfit}") from None
        spread = inflation(shape)
        return _suggestion(
            self._id_of(shape, intent, arrival_ns),
            shape,
            way,
            stamp=newest[1].stamp,
            speed_mps=self._limited(track.speed_mps),
            confidence=offer.confidence * trust(shape, self._config, spread),
            yaw_rad=track.yaw_rad,
            inflation=spread,
            note="; ".join(note for note in (offer.note, way.note) if note),
        )

    def _offer(self, intent: Intent, track: Track, vehicle: Vehicle) -> tuple[Offer, Array]:
        """The running meaning, if the intent may be a flicker; else what the intent says.

        Raises:
            RefusalError: if neither can be flown; the text says why.
        """
        running = self._running
        if running is not None and running.shape.name in PRIMITIVES:
            name = running.shape.name
            if name != intent.label and running.outweighs(intent):
                try:
                    shape, path = self._continued(name, track, vehicle)
                except UnfitError:
                    pass
                else:
                    if same(shape, running.shape):
                        note = f"still {name}: {intent.label} was said only once"
                        return Offer(shape, intent.probabilities[name], note), path
        label: str | None = intent.label
        confidence = intent.confidence
        reasons: list[str] = []
        while label is not None:
            try:
                shape, path = self._continued(label, track, vehicle)
            except UnfitError as unfit:
                reasons.append(f"{label}: {unfit}")
                label = unfit.simpler
                confidence *= SIMPLER_CONFIDENCE
            else:
                note = f"{label} instead of {reasons[0]}" if reasons else ""
                return Offer(shape, confidence, note), path
        raise RefusalError("; ".join(reasons))

    def _extended(
        self, intent: Intent, vehicle: Vehicle, arrival_ns: int
    ) -> tuple[Offer, Array] | None:
        """What geometry tells beyond the four, if that is asked for."""
        if self._config.primitives != "extended":
            return None
        way = self._history.since_rest(arrival_ns)
        shape = extended_shape(way, vehicle.here_m, self._config)
        if shape is None:
            return None
        try:
            path = continue_from(shape, vehicle)
        except UnfitError:
            return None
        return Offer(shape, intent.confidence, f"{shape.name} by the way flown"), path

    def _continued(self, name: str, track: Track, vehicle: Vehicle) -> tuple[Shape, Array]:
        """The shape of the newest motion if it is a given primitive, and the path along it.

        Raises:
            UnfitError: if it is not.
        """
        shape = newest_motion(PRIMITIVES[name], track.points_m, track.here_m, self._config)
        shape = shape.as_meant()
        return shape, continue_from(shape, vehicle)

    def _id_of(self, shape: Shape, intent: Intent, arrival_ns: int) -> int:
        """The running suggestion's number if this one means the same, else the next."""
        running = self._running
        if running is None or not same(shape, running.shape):
            self._last_id += 1
            running = Running(self._last_id, shape, arrival_ns)
        doubted = intent.label if intent.label != shape.name else None
        self._running = Running(running.id, shape, arrival_ns, doubted)
        return running.id

    def _limited(self, speed_mps: float) -> float:
        return min(max(speed_mps, self._config.min_speed_mps), self._config.max_speed_mps)

    def _present_yaw_rad(self, now_ns: int) -> float:
        """The vehicle's yaw if a fresh pose tells it, else 0."""
        newest = self._history.newest
        if newest is None or self.pose_trouble(now_ns) is not None:
            return 0.0
        return yaw_of(newest[1].orientation)


def _suggestion(
    number: int,
    shape: Shape,
    way: Way,
    *,
    stamp: int,
    speed_mps: float,
    confidence: float,
    yaw_rad: float,
    inflation: float,
    note: str,
) -> Suggestion:
    path = [(float(x), float(y), float(z), float(yaw)) for x, y, z, yaw in way.path]
    return Suggestion(
        stamp=stamp,
        seq=0,
        id=number,
        primitive=shape.name,
        params=shape.params,
        path=path,
        closed=way.closed,
        speed=speed_mps,
        fit_rms=shape.quality.rms_m,
        confidence=confidence,
        heading_sector=heading_sector(way.path[:2, :3], yaw_rad),
        params_std={name: std * inflation for name, std in shape.stds.items()},
        note=_short(note) if note else None,
    )


def _short(reason: str) -> str:
    """What fits a screen's line and the contract."""
    return reason if len(reason) <= MAX_REASON else reason[: MAX_REASON - 3] + "..."
