"""The messages of the contract, each over values drawn from its own definition."""

import contextlib
import math
from typing import Any

import msgpack
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common import messages as m
from common.topics import QUERIES, TOPICS

MESSAGES = tuple({row.message: None for row in TOPICS.values()})
PAYLOADS = (
    *MESSAGES,
    *{payload: None for row in QUERIES.values() for payload in (row.request, row.reply)},
    m.QueryError,
)
few = settings(max_examples=40, deadline=None)
PRIMITIVES = ("line", "arc", "sine", "helix")


def strategy_of(info: msgspec.inspect.Type) -> st.SearchStrategy[Any]:
    """Wire values (as `msgpack` reads them) that a type's own constraints allow."""
    match info:
        case msgspec.inspect.Metadata(type=inner):
            return strategy_of(inner)
        case msgspec.inspect.IntType(ge=ge, gt=gt, le=le):
            low = ge if ge is not None else -(2**63) if gt is None else gt + 1
            return st.integers(low, le if le is not None else 2**63 - 1)
        case msgspec.inspect.FloatType(ge=ge, gt=gt, le=le):
            return st.floats(
                ge if ge is not None else gt,
                le,
                exclude_min=gt is not None,
                allow_nan=False,
                allow_infinity=False,
            )
        case msgspec.inspect.StrType(min_length=low, max_length=high):
            return st.text("aZ_ /\u03b2\U0001f681", min_size=low or 0, max_size=min(high or 20, 20))
        case msgspec.inspect.BytesType():
            return st.binary(max_size=100)
        case msgspec.inspect.BoolType():
            return st.booleans()
        case msgspec.inspect.LiteralType(values=values):
            return st.sampled_from(values)
        case msgspec.inspect.TupleType(item_types=items):
            return st.tuples(*map(strategy_of, items)).map(list)
        case msgspec.inspect.ListType(item_type=item, min_length=low):
            return st.lists(strategy_of(item), min_size=low or 0, max_size=(low or 0) + 5)
        case msgspec.inspect.DictType(key_type=key, value_type=value):
            return st.dictionaries(strategy_of(key), strategy_of(value), max_size=5)
        case msgspec.inspect.UnionType(types=types):
            there = [t for t in types if not isinstance(t, msgspec.inspect.NoneType)]
            return st.one_of(map(strategy_of, there))
    raise NotImplementedError(info)


def coherent(payload: type[m.Payload], wire: dict[str, Any]) -> dict[str, Any]:
    """The same values where fields depend on one another."""
    if payload is m.Intent:
        shares = dict(zip(PRIMITIVES, (0.5, 0.25, 0.125, 0.125), strict=True))
        begin, end = sorted((wire["window_start"], wire["window_end"]))
        wire |= {"probabilities": shares, "window_start": begin, "window_end": end}
        wire["label"] = ("none", *PRIMITIVES)[wire["samples"] % 5]
    if payload is m.Pose:
        norm = math.hypot(*wire["orientation"])
        usable = 1e-100 < norm < 1e100
        wire["orientation"] = (
            [q / norm for q in wire["orientation"]] if usable else [0.0, 0.0, 0.0, 1.0]
        )
    return wire


@st.composite
def wires(draw: st.DrawFn, payload: type[m.Payload]) -> dict[str, Any]:
    """A valid payload as the map that travels."""
    info = msgspec.inspect.type_info(payload)
    assert isinstance(info, msgspec.inspect.StructType)
    wire = {
        field.encode_name: draw(strategy_of(field.type))
        for field in info.fields
        if field.required or draw(st.booleans())
    }
    return coherent(payload, wire)


by_payload = pytest.mark.parametrize("payload", PAYLOADS, ids=lambda p: p.__name__)
by_message = pytest.mark.parametrize("payload", MESSAGES, ids=lambda p: p.__name__)


@by_payload
@few
@given(data=st.data())
def test_what_is_encoded_is_decoded(payload: type[m.Payload], data: st.DataObject) -> None:
    wire = data.draw(wires(payload))
    message = m.decode(msgpack.packb(wire), payload)
    assert m.decode(m.encode(message), payload) == message
    assert msgpack.unpackb(m.encode(message)) == wire


@by_payload
@few
@given(data=st.data())
def test_unknown_fields_are_ignored(payload: type[m.Payload], data: st.DataObject) -> None:
    wire = data.draw(wires(payload))
    more = {**wire, "flavour": "new", "deep": {"er": [1, None, {"x": float("nan")}]}}
    assert m.decode(msgpack.packb(more), payload) == m.decode(msgpack.packb(wire), payload)


@by_message
@few
@given(data=st.data())
def test_every_missing_field_is_refused_by_name(
    payload: type[m.Message], data: st.DataObject
) -> None:
    wire = data.draw(wires(payload))
    info = msgspec.inspect.type_info(payload)
    assert isinstance(info, msgspec.inspect.StructType)
    for field in info.fields:
        if field.required:
            short = {k: v for k, v in wire.items() if k != field.encode_name}
            with pytest.raises(m.InvalidPayloadError, match=field.encode_name):
                m.decode(msgpack.packb(short), payload)


@by_message
@few
@given(data=st.data(), wrong=st.sampled_from([{"not": "this"}, None, [[[]]], b"\x00"]))
def test_every_wrong_type_is_refused(
    payload: type[m.Message], data: st.DataObject, wrong: Any
) -> None:
    wire = data.draw(wires(payload))
    field = data.draw(st.sampled_from(sorted(wire)))
    if isinstance(wrong, bytes) and isinstance(wire[field], bytes):
        return
    if wrong is None and field in ("buttons", "params_std", "note", "full_stick", "rates"):
        return
    with pytest.raises(m.InvalidPayloadError, match=field):
        m.decode(msgpack.packb({**wire, field: wrong}), payload)


def floats_in(wire: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where the floats of a map are."""
    if isinstance(wire, float):
        return [path]
    if isinstance(wire, dict):
        return [place for key, value in wire.items() for place in floats_in(value, (*path, key))]
    if isinstance(wire, list):
        return [place for i, value in enumerate(wire) for place in floats_in(value, (*path, i))]
    return []


def replaced(wire: Any, path: tuple[Any, ...], value: float) -> Any:
    if not path:
        return value
    copy = dict(wire) if isinstance(wire, dict) else list(wire)
    copy[path[0]] = replaced(wire[path[0]], path[1:], value)
    return copy


@by_payload
@few
@given(data=st.data(), bad=st.sampled_from([math.nan, math.inf, -math.inf]))
def test_no_float_is_nan_or_infinite(
    payload: type[m.Payload], data: st.DataObject, bad: float
) -> None:
    wire = data.draw(wires(payload))
    places = floats_in(wire)
    if not places:
        return
    place = data.draw(st.sampled_from(places))
    with pytest.raises(m.InvalidPayloadError):
        m.decode(msgpack.packb(replaced(wire, place, bad)), payload)


def test_finite_floats_whose_sum_is_not_are_no_infinity() -> None:
    huge = (1e308, 1e308, 1e308)
    request = m.ClassifyRequest(samples=[huge, huge], rate=50.0)
    assert m.decode(m.encode(request), m.ClassifyRequest) == request


@by_payload
@few
@given(data=st.data())
def test_every_bound_is_kept(payload: type[m.Payload], data: st.DataObject) -> None:
    wire = data.draw(wires(payload))
    info = msgspec.inspect.type_info(payload)
    assert isinstance(info, msgspec.inspect.StructType)
    for field in info.fields:
        inner = field.type
        while isinstance(inner, msgspec.inspect.Metadata):
            inner = inner.type
        beyond: list[Any] = []
        if isinstance(inner, (msgspec.inspect.IntType, msgspec.inspect.FloatType)):
            kind = int if isinstance(inner, msgspec.inspect.IntType) else float
            beyond += [kind(inner.ge - 1)] if inner.ge is not None else []
            beyond += [kind(inner.gt)] if inner.gt is not None else []
            beyond += [kind(inner.le + 1)] if inner.le is not None else []
        if isinstance(inner, msgspec.inspect.LiteralType):
            beyond.append("something else")
        for value in beyond:
            if isinstance(value, int) and not -(2**63) <= value < 2**64:
                continue  # MessagePack itself has no such number
            with pytest.raises(m.InvalidPayloadError, match=field.encode_name):
                m.decode(msgpack.packb({**wire, field.encode_name: value}), payload)


@by_payload
@few
@given(noise=st.binary(max_size=300))
def test_noise_is_refused_or_a_payload_but_never_an_error(
    payload: type[m.Payload], noise: bytes
) -> None:
    with contextlib.suppress(m.InvalidPayloadError):
        m.decode(noise, payload)


@by_message
def test_what_is_no_whole_map_is_refused(payload: type[m.Message]) -> None:
    for data in (b"", b"\x90", b"\x80", b"\xc0", b"\x81", b"\x81\xa4deep" + b"\x91" * 100_000):
        with pytest.raises(m.InvalidPayloadError):
            m.decode(data, payload)


INTENT = {
    "stamp": 1,
    "seq": 0,
    "label": "arc",
    "probabilities": {"line": 0.2, "arc": 0.8, "sine": 0.0, "helix": 0.0},
    "confidence": 0.8,
    "window_start": 0,
    "window_end": 1,
    "samples": 10,
    "model": "m",
}


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"probabilities": {"line": 0.2, "arc": 0.7}}, "sum to"),
        ({"probabilities": {}}, "sum to"),
        ({"probabilities": {"line": 0.2, "arc": 0.8}}, "lack sine, helix"),
        ({"label": "loop"}, "not among"),
        ({"window_end": -1}, "before"),
    ],
)
def test_an_intent_that_contradicts_itself_is_refused(
    changes: dict[str, Any], complaint: str
) -> None:
    assert m.decode(msgpack.packb(INTENT), m.Intent)
    with pytest.raises(m.InvalidPayloadError, match=complaint):
        m.decode(msgpack.packb(INTENT | changes), m.Intent)


def test_an_orientation_is_a_unit_quaternion() -> None:
    pose = {
        "stamp": 1,
        "seq": 0,
        "position": [0.0] * 3,
        "orientation": [0.0, 0.0, 0.0, 1.0],
        "velocity": [0.0] * 3,
        "angular_velocity": [0.0] * 3,
        "covariance": [0.0] * 6,
        "status": "ok",
        "source": "test",
    }
    assert m.decode(msgpack.packb(pose), m.Pose)
    for wrong in ([0.0] * 4, [0.0, 0.0, 0.0, 2.0]):
        with pytest.raises(m.InvalidPayloadError, match="norm"):
            m.decode(msgpack.packb({**pose, "orientation": wrong}), m.Pose)


def test_absent_options_do_not_travel() -> None:
    stick = m.Stick(stamp=1, seq=2, vx=0.0, vy=0.0, vz=0.0, wz=0.0)
    assert set(msgpack.unpackb(m.encode(stick))) == {"stamp", "seq", "vx", "vy", "vz", "wz"}


def test_encodings_name_message_and_version() -> None:
    assert m.encoding_of(m.Stick) == "application/msgpack;Stick/1"


@by_message
def test_the_schema_requires_what_decoding_requires(payload: type[m.Message]) -> None:
    schema = m.json_schema_of(payload)["$defs"][payload.__name__]
    info = msgspec.inspect.type_info(payload)
    assert isinstance(info, msgspec.inspect.StructType)
    assert set(schema["required"]) == {f.encode_name for f in info.fields if f.required}
