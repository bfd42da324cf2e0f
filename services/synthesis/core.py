"""From an intent and the poses of its window to a suggestion, or to the reason for none."""

import math

import numpy as np

from common.clock import seconds
from common.frames import Array, yaw_of
from common.messages import NONE_LABEL, FitRequest, Intent, Pose, Suggestion
from common.topics import TOPICS
from services.synthesis.config import Config
from services.synthesis.continuation import continue_from, heading_sector
from services.synthesis.history import CELL_M, History, Track
from services.synthesis.primitives import PRIMITIVES
from services.synthesis.primitives.shape import Shape, UnfitError

POSE_MAX_AGE_S = TOPICS["pose"].max_age_s
PARTS = (1.0, 0.75, 0.5, 0.35)
"""Shares of the window's way, newest part, that are tried: a motion may begin as another one."""
CORRELATION_M = 0.5
"""A hand and an estimator err smoothly: points closer than this do not err independently."""
MIN_ERROR_M = 0.005
"""No estimate is trusted to be better than this, however well few points fit."""
CONSISTENT_SIGMAS = 3.0
MAX_POINTS = 400
"""More points of a request than this are averaged in groups of neighbours."""
MAX_COORDINATE_M = 1e5
SIMPLER_CONFIDENCE = 0.5
"""Factor on the confidence when geometry says something simpler than the intent."""


class RefusalError(Exception):
    """There is nothing to suggest; the text says why, `field` which part of a request is to blame.

    A normal answer, not a failure.
    """

    def __init__(self, reason: str, field: str | None = None) -> None:
        super().__init__(reason)
        self.field = field


class Synthesizer:
    """Holds the pose history and counts suggestions."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._history = History()
        self._last_id = 0
        self.last_refusal: str | None = None
        """Why the newest intent led to no suggestion; None if it did, or there was none."""

    def on_pose(self, pose: Pose, arrival_ns: int) -> None:
        """Remember where the vehicle is."""
        self._history.add(pose, arrival_ns)

    def on_intent(self, intent: Intent, arrival_ns: int) -> Suggestion | None:
        """A suggestion, or None with the reason in `last_refusal`."""
        try:
            suggestion = self._suggest(intent, arrival_ns)
        except RefusalError as refusal:
            self.last_refusal = str(refusal)
            return None
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

        Args:
            request: a primitive, and points whose errors are independent.
            stamp: of the suggestion, ns.
            now_ns: the receiver's monotonic time; a fresh pose tells where the body's x points, by
                which `heading_sector` is counted, else it is world x.

        Raises:
            RefusalError: if the points do not determine such a primitive.
        """
        if request.primitive not in PRIMITIVES:
            known = ", ".join(PRIMITIVES)
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
            shape = _fit(PRIMITIVES[request.primitive], points, here)
            _check(shape, self._config, inflation=1.0)
            path = continue_from(shape, here, yaw_rad=None)
        except UnfitError as unfit:
            raise RefusalError(f"{request.primitive}: {unfit}", "points") from None
        return self._suggestion(
            shape,
            path,
            stamp=stamp,
            speed_mps=request.speed or self._config.cruise_mps,
            confidence=_trust(shape, self._config, inflation=1.0),
            yaw_rad=self._present_yaw_rad(now_ns),
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

        label: str | None = intent.label
        confidence = intent.confidence
        reasons: list[str] = []
        while label is not None:
            try:
                shape = _newest_motion(PRIMITIVES[label], track, self._config).as_meant()
                path = continue_from(
                    shape, track.here_m, track.yaw_rad, min_height_m=self._config.min_height_m
                )
            except UnfitError as unfit:
                reasons.append(f"{label}: {unfit}")
                label = unfit.simpler
                confidence *= SIMPLER_CONFIDENCE
                continue
            return self._suggestion(
                shape,
                path,
                stamp=newest[1].stamp,
                speed_mps=track.speed_mps,
                confidence=confidence * _trust(shape, self._config, _inflation(shape)),
                yaw_rad=track.yaw_rad,
            )
        raise RefusalError("; ".join(reasons))

    def _suggestion(
        self,
        shape: Shape,
        path: list[tuple[float, float, float, float]],
        *,
        stamp: int,
        speed_mps: float,
        confidence: float,
        yaw_rad: float,
    ) -> Suggestion:
        self._last_id += 1
        return Suggestion(
            stamp=stamp,
            seq=0,
            id=self._last_id,
            primitive=shape.name,
            params=shape.params,
            path=path,
            closed=shape.closed,
            speed=min(max(speed_mps, self._config.min_speed_mps), self._config.max_speed_mps),
            fit_rms=shape.quality.rms_m,
            confidence=confidence,
            heading_sector=heading_sector(np.array(path[:2])[:, :3], yaw_rad),
        )

    def _present_yaw_rad(self, now_ns: int) -> float:
        """The vehicle's yaw if a fresh pose tells it, else 0."""
        newest = self._history.newest
        if newest is None or self.pose_trouble(now_ns) is not None:
            return 0.0
        return yaw_of(newest[1].orientation)


def _newest_motion(primitive: type[Shape], track: Track, config: Config) -> Shape:
    """The shape of what the vehicle is doing now, from as much of the way as is part of it.

    A window may begin with another motion. So parts of it are tried, the newest first, and the
    longest is taken whose estimate agrees with those of all shorter ones within their errors
    (Lepski's rule).

    Raises:
        UnfitError: if no part makes a shape that may be flown.
    """
    parts = [track.points_m[-round(share * len(track.points_m)) :] for share in PARTS]
    parts = [points for points in parts if len(points) * CELL_M >= config.min_extent_m]
    if not primitive.steady:
        return _longest_acceptable(primitive, parts, track, config)
    chosen: list[Shape] = []
    unfit = UnfitError("the way is too short")
    for points in reversed(parts):
        try:
            shape = _fit(primitive, points, track.here_m)
        except UnfitError as error:
            unfit = error
            continue
        if not all(_agree(shape, shorter) for shorter in chosen):
            break
        chosen.append(shape)
    if not chosen:
        raise unfit
    _check(chosen[-1], config, _inflation(chosen[-1]))
    return chosen[-1]


def _longest_acceptable(
    primitive: type[Shape], parts: list[Array], track: Track, config: Config
) -> Shape:
    """The shape of the longest part that makes one that may be flown, or the longest's reason."""
    first: UnfitError | None = None
    for points in parts:
        try:
            shape = _fit(primitive, points, track.here_m)
            _check(shape, config, _inflation(shape))
        except UnfitError as error:
            first = first or error
            continue
        return shape
    raise first or UnfitError("the way is too short")


def _fit(primitive: type[Shape], points_m: Array, here_m: Array) -> Shape:
    if len(points_m) < primitive.min_points:
        raise UnfitError(f"{len(points_m)} points are too few; {primitive.min_points} are needed")
    try:
        return primitive.fit(points_m, here_m)
    except (np.linalg.LinAlgError, FloatingPointError, OverflowError):
        raise UnfitError("the points do not determine it") from None


def _check(shape: Shape, config: Config, inflation: float) -> None:
    """Raise UnfitError if a shape may not be flown; its errors are `inflation` times larger."""
    quality = shape.quality
    if quality.extent_m < config.min_extent_m:
        raise UnfitError(f"only {quality.extent_m:.2f} m of it were flown")
    shape.check(config)
    if quality.rms_m > shape.rms_limit_m:
        raise UnfitError(
            f"it fits to {quality.rms_m:.2f} m only, {shape.rms_limit_m:.2f} m are allowed"
        )
    doubt = quality.doubt * inflation
    if not doubt <= config.max_doubt:
        raise UnfitError(f"it is known to {doubt:.0%} only, {config.max_doubt:.0%} are allowed")


def _inflation(shape: Shape) -> float:
    """How much larger errors are than those of points that err independently."""
    quality = shape.quality
    independent = max(quality.extent_m / CORRELATION_M, 2.0)
    floor = max(1.0, MIN_ERROR_M / max(quality.rms_m, 1e-9))
    return floor * math.sqrt(max(quality.count / independent, 1.0))


def _agree(shape: Shape, other: Shape) -> bool:
    """Whether two parts of the way have the same estimate within their errors."""
    spread = math.hypot(
        shape.quality.estimate_std * _inflation(shape),
        other.quality.estimate_std * _inflation(other),
    )
    difference = shape.quality.estimate - other.quality.estimate
    if math.isfinite(shape.estimate_period):
        difference = math.remainder(difference, shape.estimate_period)
    return abs(difference) <= CONSISTENT_SIGMAS * spread


def _trust(shape: Shape, config: Config, inflation: float) -> float:
    """How good a fit is, from 1 for exact to 0.25 for just acceptable."""
    misfit = min(shape.quality.rms_m / shape.rms_limit_m, 1.0)
    doubt = min(shape.quality.doubt * inflation / config.max_doubt, 1.0)
    return (1.0 - 0.5 * misfit) * (1.0 - 0.5 * doubt)
