"""Payloads written by hand from the contract: a good one each, and ways to spoil it."""

import os
import time
from collections.abc import Iterator
from typing import Any

import msgpack
from conftest import Client

STAMP = 1_700_000_000_000_000_000
HEAD = {"stamp": STAMP, "seq": 7}

GOOD: dict[str, dict[str, Any]] = {
    "Stick": {**HEAD, "vx": 0.5, "vy": 0.0, "vz": 0.0, "wz": 0.1},
    "Intent": {
        **HEAD,
        "label": "line",
        "probabilities": {"line": 0.91, "arc": 0.05, "sine": 0.03, "helix": 0.01},
        "confidence": 0.91,
        "window_start": STAMP - 2_000_000_000,
        "window_end": STAMP,
        "samples": 100,
        "model": "test-0000",
    },
    "Suggestion": {
        **HEAD,
        "id": 1,
        "primitive": "line",
        "params": {"x": 0.0, "y": 0.0, "z": 1.0, "heading": 0.0, "climb": 0.0},
        "path": [[0.1 * i, 0.0, 1.0, 0.0] for i in range(60)],
        "closed": False,
        "speed": 0.8,
        "fit_rms": 0.02,
        "confidence": 0.9,
        "heading_sector": 0,
    },
    "Refusal": {**HEAD, "label": "arc", "reason": "it cannot be told from a line"},
    "AutopilotStatus": {
        **HEAD,
        "mode": "manual",
        "suggestion": 0,
        "progress": 0.0,
        "cross_track": 0.0,
        "reason": "stick",
    },
    "Command": {
        **HEAD,
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
        "wz": 0.0,
        "action": "fly",
        "mode": "manual",
    },
    "Pose": {
        **HEAD,
        "position": [0.0, 0.0, 1.0],
        "orientation": [0.0, 0.0, 0.0, 1.0],
        "velocity": [0.0, 0.0, 0.0],
        "angular_velocity": [0.0, 0.0, 0.0],
        "covariance": [0.01, 0.01, 0.01, 0.001, 0.001, 0.001],
        "status": "ok",
        "source": "test",
    },
    "Imu": {
        **HEAD,
        "angular_velocity": [0.0, 0.0, 0.0],
        "linear_acceleration": [0.0, 0.0, 9.81],
        "magnetic_field": [0.0, 1.0, 0.0],
    },
    "Range": {**HEAD, "range": 1.0, "min": 0.01, "max": 3.0},
    "VehicleStatus": {
        **HEAD,
        "state": "flying",
        "battery": 0.9,
        "world": "track",
        "plant": "tum",
        "collisions": 0,
    },
    "Image": {
        **HEAD,
        "width": 64,
        "height": 48,
        "format": "jpeg",
        "data": b"\xff\xd8 not a whole picture \xff\xd9",
        "intrinsics": [60.0, 60.0, 31.5, 23.5],
        "distortion": [0.0, 0.0, 0.0, 0.0],
        "capture": STAMP - 5_000_000,
    },
    "Health": {
        **HEAD,
        "service": "sim",
        "version": "0.1.0",
        "state": "ok",
        "detail": "",
        "rates": {"command": 50.0},
        "rejected": {"command": 0},
        "latency_p50": 0.001,
        "latency_p99": 0.002,
    },
}

_OUT_OF_RANGE: dict[str, dict[str, Any]] = {
    "Stick": {"vx": 1.5},
    "Intent": {"confidence": 1.5},
    "Suggestion": {"id": 0},
    "Refusal": {"label": ""},
    "AutopilotStatus": {"mode": "asleep"},
    "Command": {"vx": -7.0},
    "Pose": {"status": "perhaps"},
    "Imu": {"seq": -1},
    "Range": {"min": -1.0},
    "VehicleStatus": {"battery": 3.0},
    "Image": {"width": 0},
    "Health": {"latency_p50": -1.0},
}
_FLOAT_FIELD: dict[str, str] = {
    "Stick": "vx",
    "Intent": "confidence",
    "Suggestion": "speed",
    "AutopilotStatus": "cross_track",
    "Command": "vx",
    "Range": "range",
    "VehicleStatus": "battery",
    "Health": "latency_p99",
}


def bad_payloads(message: str) -> Iterator[tuple[str, bytes]]:
    """Every kind of bad input for a message, named."""
    good = GOOD[message]
    for field in good:
        yield f"without {field}", msgpack.packb({k: v for k, v in good.items() if k != field})
        yield f"{field} of a wrong type", msgpack.packb({**good, field: {"not": ["this"]}})
    if message in _FLOAT_FIELD:
        for value in (float("nan"), float("inf"), float("-inf")):
            yield f"{value}", msgpack.packb({**good, _FLOAT_FIELD[message]: value})
    if message in ("Pose", "Imu"):
        field = "velocity" if message == "Pose" else "linear_acceleration"
        yield "NaN in a list", msgpack.packb({**good, field: [float("nan"), 0.0, 0.0]})
        yield "a short list", msgpack.packb({**good, field: [0.0, 0.0]})
    yield "out of range", msgpack.packb({**good, **_OUT_OF_RANGE[message]})
    yield "a list, not a map", msgpack.packb(list(good.values()))
    yield "nothing", b""
    yield "a truncated map", msgpack.packb(good)[:-3]
    yield "1 MB of noise", os.urandom(1_000_000)


def with_unknown_fields(message: str) -> dict[str, Any]:
    """A good message from a newer sender."""
    return {**GOOD[message], "flavour": "new", "more": {"nested": [1, 2, 3]}}


def assert_bad_input_is_dropped_and_counted(
    client: Client, service: str, topic: str, message: str
) -> None:
    """Each kind of bad payload counts once in `health.rejected`, and the service goes on."""
    bad = list(bad_payloads(message))
    before = client.next(f"health/{service}")["rejected"][topic]
    for _, payload in bad:
        client.put(topic, payload)
        # Streams keep the newest only: a reader must get the chance to see each one.
        _settle()
    expected = before + len(bad)
    health = client.next(
        f"health/{service}", lambda h: h["rejected"][topic] >= expected, timeout_s=5.0
    )
    assert health["rejected"][topic] == expected
    client.put(topic, msgpack.packb(with_unknown_fields(message)))
    _settle()
    assert client.next(f"health/{service}")["rejected"][topic] == expected


def _settle() -> None:
    time.sleep(0.04)
