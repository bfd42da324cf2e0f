"""The messages of the wire contract, version 1: typed, validated, MessagePack maps on the wire.

Decoding refuses a missing field, a wrong type, a value out of its range, NaN and infinity; unknown
fields are ignored. World frame ENU, body frame FLU, SI units, radians, quaternions [x, y, z, w].
"""

import itertools
import math
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta

from common import CONTRACT_VERSION

Stamp = Annotated[
    int, Meta(ge=-(2**63), le=2**63 - 1, description="ns on the clock of the session")
]
Seq = Annotated[int, Meta(ge=0)]
Count = Annotated[int, Meta(ge=0)]
Fraction = Annotated[float, Meta(ge=-1.0, le=1.0)]
Confidence = Annotated[float, Meta(ge=0.0, le=1.0)]
NonNegative = Annotated[float, Meta(ge=0.0)]
Name = Annotated[str, Meta(min_length=1, max_length=64)]
Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
PathPoint = Annotated[
    tuple[float, float, float, float], Meta(description="x y z in m, yaw in rad, world frame")
]

NONE_LABEL = "none"
PRIMITIVES = ("line", "arc", "sine", "helix")
"""Those that every model knows; it may know more."""
PROBABILITY_SUM_TOLERANCE = 1e-3
QUATERNION_NORM_TOLERANCE = 1e-2

FlightMode = Literal["manual", "engaged", "hover", "landed", "emergency"]
CommandAction = Literal["fly", "takeoff", "land", "emergency"]
DecideAction = Literal["accept", "cancel", "takeoff", "land", "emergency"]
PoseStatus = Literal["ok", "degraded", "lost"]
VehicleState = Literal["landed", "taking_off", "flying", "landing", "emergency"]
HealthState = Literal["ok", "degraded", "failed"]
Plant = Annotated[
    str,
    Meta(min_length=1, max_length=32, description="`tum`, `ardrone`, or another kind of vehicle"),
]
FullStickSpeeds = Annotated[
    tuple[NonNegative, NonNegative, NonNegative, NonNegative, NonNegative],
    Meta(description="forward, left, up, down in m/s, turn in rad/s"),
]
FollowingRates = Annotated[
    tuple[NonNegative, NonNegative, NonNegative],
    Meta(description="level, upright, turn in 1/s"),
]


def _require_finite(value: object, field: str) -> None:
    """Raise ValueError if `value`, or anything in it, is NaN or infinite."""
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{field} is not finite")
    elif isinstance(value, (tuple, list)):
        for item in value:
            _require_finite(item, field)
    elif isinstance(value, dict):
        for item in value.values():
            _require_finite(item, field)


def _is_finite_table(rows: list[Any]) -> bool:
    """Whether these are tuples of numbers, as paths and windows are, with a finite sum."""
    return (
        bool(rows)
        and type(rows[0]) is tuple
        and math.isfinite(sum(itertools.chain.from_iterable(rows)))
    )


class Payload(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A MessagePack map whose floats are all finite. Optional fields are left out when None."""

    def __post_init__(self) -> None:
        for field in self.__struct_fields__:
            value = getattr(self, field)
            kind = type(value)
            # Thousands a second, so the usual kinds are told here. A sum is finite unless one of
            # its terms is not, or it overflows, which the close look clears up.
            if (
                kind is int
                or kind is str
                or (kind is float and math.isfinite(value))
                or (kind is tuple and math.isfinite(sum(value)))
                or (kind is list and _is_finite_table(value))
            ):
                continue
            _require_finite(value, field)


class Message(Payload, frozen=True, kw_only=True):
    """What is published on a topic. `seq` is set by the publisher's node (see common/node.py)."""

    stamp: Stamp
    seq: Seq


class Stick(Message, frozen=True, kw_only=True):
    """The operator's sticks as fractions of full stick: forward, left, up, counter-clockwise."""

    vx: Fraction
    vy: Fraction
    vz: Fraction
    wz: Fraction
    buttons: list[str] | None = None


class Intent(Message, frozen=True, kw_only=True):
    """What the operator means; `stamp` is that of the newest stick used (`window_end`)."""

    label: Name
    probabilities: dict[str, NonNegative]
    confidence: Confidence
    window_start: Stamp
    window_end: Stamp
    samples: Count
    model: str

    def __post_init__(self) -> None:
        super().__post_init__()
        total = sum(self.probabilities.values())
        if abs(total - 1.0) > PROBABILITY_SUM_TOLERANCE:
            raise ValueError(f"probabilities sum to {total:.4f}, not 1")
        missing = [name for name in PRIMITIVES if name not in self.probabilities]
        if missing:
            raise ValueError(f"probabilities lack {', '.join(missing)}")
        if self.label != NONE_LABEL and self.label not in self.probabilities:
            raise ValueError(f"label {self.label!r} is not among the probabilities")
        if self.window_end < self.window_start:
            raise ValueError("window_end is before window_start")


class Suggestion(Message, frozen=True, kw_only=True):
    """A path that continues the operator's motion, starting at the vehicle.

    The same `id` again is the same meaning with a newer path. The end of a `closed` path joins its
    start: it may be flown again and again. `speed` is in m/s, `fit_rms` in m. `heading_sector` is
    the direction of travel in sectors of 45 degrees, 0 along the body's x, counter-clockwise.

    `params` describe the shape in the world frame. `line`: a point `x y z`, `heading` (of travel)
    and `climb` in rad. `arc`: centre `cx cy`, `z`, `radius`, `sweep` (rad in all, +
    counter-clockwise). `helix`: as an arc, and `pitch` (m a turn, + up). `sine`: the point `x y z`
    of its axis beside the vehicle, `heading`, `amplitude`, `wavelength`, `phase` there.
    `params_std` holds standard errors by their names, `note` why the path is simpler, shorter or
    slower than what was asked.
    """

    id: Annotated[int, Meta(gt=0)]
    primitive: Name
    params: dict[str, float]
    path: Annotated[list[PathPoint], Meta(min_length=2, max_length=4096)]
    closed: bool
    speed: NonNegative
    fit_rms: NonNegative
    confidence: Confidence
    heading_sector: Annotated[int, Meta(ge=0, le=7)]
    params_std: dict[str, NonNegative] | None = None
    note: Annotated[str, Meta(max_length=200)] | None = None


class Refusal(Message, frozen=True, kw_only=True):
    """Why what the operator means, `label`, is not suggested: for the screen."""

    label: Name
    reason: Annotated[str, Meta(max_length=200)]


class AutopilotStatus(Message, frozen=True, kw_only=True):
    """Who flies, along which suggestion (0: none), and why the mode last changed.

    `progress` is how far along the path, `cross_track` how far beside it, in m.
    """

    mode: FlightMode
    suggestion: Count
    progress: float
    cross_track: float
    reason: str


class Command(Message, frozen=True, kw_only=True):
    """What the vehicle is to do now; sticks as in `Stick`."""

    vx: Fraction
    vy: Fraction
    vz: Fraction
    wz: Fraction
    action: CommandAction
    mode: FlightMode


class Pose(Message, frozen=True, kw_only=True):
    """Position and motion of the body in the world, with variances of x y z roll pitch yaw."""

    position: Vector3
    orientation: Quaternion
    velocity: Vector3
    angular_velocity: Vector3
    covariance: tuple[NonNegative, NonNegative, NonNegative, NonNegative, NonNegative, NonNegative]
    status: PoseStatus
    source: str

    def __post_init__(self) -> None:
        super().__post_init__()
        norm = math.hypot(*self.orientation)
        if abs(norm - 1.0) > QUATERNION_NORM_TOLERANCE:
            raise ValueError(f"orientation has norm {norm:.4f}, not 1")


class Imu(Message, frozen=True, kw_only=True):
    """Body rates, specific force (+9.81 up at rest) and magnetic field, body frame."""

    angular_velocity: Vector3
    linear_acceleration: Vector3
    magnetic_field: Vector3


class Range(Message, frozen=True, kw_only=True):
    """A distance along one beam; `min` and `max` are what the instrument can measure."""

    range: float
    min: NonNegative
    max: NonNegative


class Image(Message, frozen=True, kw_only=True):
    """A picture with its lens. `capture` is when it was taken, carried through later stages.

    `intrinsics` are fx fy cx cy in pixels, `distortion` k1 k2 p1 p2.
    """

    width: Annotated[int, Meta(gt=0, le=8192)]
    height: Annotated[int, Meta(gt=0, le=8192)]
    format: Literal["jpeg"]
    data: bytes
    intrinsics: tuple[float, float, float, float]
    distortion: tuple[float, float, float, float]
    capture: Stamp


class VehicleStatus(Message, frozen=True, kw_only=True):
    """The vehicle's own state.

    One that is neither `tum` nor `ardrone` says how it follows the stick: its steady speeds at full
    stick, and how fast each comes, as dv/dt = rate (speed - v); 0 where it cannot move at all.
    """

    state: VehicleState
    battery: Confidence
    world: str
    plant: Plant
    collisions: Count
    full_stick: FullStickSpeeds | None = None
    rates: FollowingRates | None = None


class Health(Message, frozen=True, kw_only=True):
    """How a service is doing, once a second.

    By topic, `rates` are what it hears in Hz, `rejected` how many payloads were invalid.
    `latency_p50` and `latency_p99` are of its own main step, in s.
    """

    service: Name
    version: str
    state: HealthState
    detail: str
    rates: dict[str, NonNegative]
    rejected: dict[str, Count]
    latency_p50: NonNegative
    latency_p99: NonNegative


class DecideRequest(Payload, frozen=True, kw_only=True):
    """What the operator decides; the same nonce again has no second effect.

    `accept` takes the `suggestion` of that id, or the newest if none is named; one that is unknown
    or stale is refused.
    """

    action: DecideAction
    nonce: int
    suggestion: Count | None = None


class DecideReply(Payload, frozen=True, kw_only=True):
    """The autopilot's answer to a decision."""

    ok: bool
    reason: str
    mode: FlightMode


class ClassifyRequest(Payload, frozen=True, kw_only=True):
    """Sticks to classify: rows of vx, vy, vz at a constant rate."""

    samples: Annotated[list[Vector3], Meta(min_length=1, max_length=100_000)]
    rate: Annotated[float, Meta(gt=0.0, le=10_000.0)]


class FitRequest(Payload, frozen=True, kw_only=True):
    """Points, oldest first, through which a primitive is to be fitted.

    A `speed` beyond the service's limits is brought into them, and the answer's `note` says so.
    """

    primitive: Name
    points: Annotated[list[Vector3], Meta(min_length=2, max_length=100_000)]
    speed: Annotated[float, Meta(gt=0.0)] | None = None


class ResetRequest(Payload, frozen=True, kw_only=True):
    """Where and in which world the simulator starts anew; absent fields stay as they are."""

    world: str | None = None
    position: Vector3 | None = None
    yaw: float | None = None
    seed: Annotated[int, Meta(ge=0)] | None = None
    plant: str | None = None


class WorldsRequest(Payload, frozen=True, kw_only=True):
    """Asks which worlds the simulator knows."""


class WorldsReply(Payload, frozen=True, kw_only=True):
    """The worlds the simulator knows."""

    worlds: list[str]


class QueryError(Payload, frozen=True, kw_only=True):
    """The reply to a bad request: what is wrong, and in which field."""

    error: str
    field: str | None = None


P = TypeVar("P", bound=Payload)

_encoder = msgspec.msgpack.Encoder()
_decoders: dict[type[Payload], msgspec.msgpack.Decoder[Any]] = {}


class InvalidPayloadError(ValueError):
    """A payload that the contract does not allow; the text says which field and why."""


def encode(payload: Payload) -> bytes:
    """The MessagePack map of a payload."""
    return _encoder.encode(payload)


def decode(data: bytes, message: type[P]) -> P:
    """The payload in `data`.

    Raises:
        InvalidPayloadError: if the contract does not allow it.
    """
    decoder = _decoders.get(message)
    if decoder is None:
        decoder = _decoders[message] = msgspec.msgpack.Decoder(message)
    try:
        payload: P = decoder.decode(data)
    except (msgspec.DecodeError, RecursionError, OverflowError, UnicodeDecodeError) as error:
        raise InvalidPayloadError(str(error)) from None
    return payload


def encoding_of(message: type[Payload]) -> str:
    """The Zenoh encoding of a payload type."""
    return f"application/msgpack;{message.__name__}/{CONTRACT_VERSION}"


def json_schema_of(message: type[Payload]) -> dict[str, Any]:
    """The JSON Schema of a payload type, as recordings carry it."""
    return msgspec.json.schema(message)
