"""The synthesis service from outside: poses and intents in, suggestions out, `synthesis/fit`."""

import math
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgpack
import pytest
from conftest import (
    Client,
    Launch,
    Process,
    Streams,
    assert_starts_before_its_router,
    assert_stops_without_a_router,
    start_service,
)
from payloads import assert_bad_input_is_dropped_and_counted, with_unknown_fields

SERVICE = "synthesis"
RADIUS, SPEED, HEIGHT = 2.0, 0.9, 1.2
CENTRE = (3.0, -1.0)
POSE_RATE_HZ = 100.0
PARAMS = {
    "line": {"x", "y", "z", "heading", "climb"},
    "arc": {"cx", "cy", "z", "radius", "sweep"},
    "helix": {"cx", "cy", "z", "radius", "sweep", "pitch"},
    "sine": {"x", "y", "z", "heading", "amplitude", "wavelength", "phase"},
}


@pytest.fixture(scope="module")
def service(launch: Launch, client: Client) -> Iterator[Process]:
    return start_service(launch, client, SERVICE)


def pose(x: float, y: float, z: float, yaw: float, **fields: Any) -> dict[str, Any]:
    return {
        "position": [x, y, z],
        "orientation": [0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)],
        "velocity": [SPEED * math.cos(yaw), SPEED * math.sin(yaw), 0.0],
        "angular_velocity": [0.0, 0.0, 0.0],
        "covariance": [0.01, 0.01, 0.01, 0.001, 0.001, 0.001],
        "status": "ok",
        "source": "test",
        **fields,
    }


def on_circle(sense: float, climb_mps: float = 0.0) -> Callable[[float], dict[str, Any]]:
    def at(t_s: float) -> dict[str, Any]:
        angle = sense * SPEED * t_s / RADIUS
        return pose(
            CENTRE[0] + RADIUS * math.cos(angle),
            CENTRE[1] + RADIUS * math.sin(angle),
            HEIGHT + climb_mps * t_s,
            angle + sense * math.pi / 2.0,
        )

    return at


def on_line(heading: float, yaw: float) -> Callable[[float], dict[str, Any]]:
    def at(t_s: float) -> dict[str, Any]:
        way = SPEED * t_s
        return pose(way * math.cos(heading), way * math.sin(heading), HEIGHT, yaw)

    return at


def intent(label: str, window_s: float = 2.0) -> dict[str, Any]:
    primitives = ("line", "arc", "sine", "helix")
    end = time.time_ns() - 50_000_000_000  # another machine's clock
    return {
        "label": label,
        "probabilities": {
            name: 0.9 if name == label else 0.1 / 3 if label in primitives else 0.25
            for name in primitives
        },
        "confidence": 0.9,
        "window_start": end - round(window_s * 1e9),
        "window_end": end,
        "samples": 100,
        "model": "test-0000",
    }


def suggestion_after(client: Client, label: str, flown_s: float = 2.2) -> dict[str, Any]:
    """Let the vehicle fly, tell the intent, and wait for the suggestion."""
    suggestions = client.collect("suggestion")
    time.sleep(flown_s)
    seen = len(suggestions)
    client.publish("intent", intent(label))
    deadline = time.monotonic() + 2.0
    while len(suggestions) == seen:
        assert time.monotonic() < deadline, client.next(f"health/{SERVICE}")["detail"]
        time.sleep(0.005)
    return suggestions[seen]


def assert_no_suggestion(client: Client, message: dict[str, Any], reason: str) -> None:
    suggestions, refusals = client.collect("suggestion"), client.collect("refusal")
    time.sleep(0.1)
    seen, refused = len(suggestions), len(refusals)
    client.publish("intent", message)
    health = client.next(f"health/{SERVICE}", lambda h: reason in h["detail"], timeout_s=4.0)
    assert health["service"] == SERVICE
    assert len(suggestions) == seen
    told = refusals[refused:]
    if message["label"] == "none":
        assert not told
        return
    assert [each["label"] for each in told] == [message["label"]]
    assert reason in told[0]["reason"]
    assert set(refusals.encodings) == {"application/msgpack;Refusal/1"}


def assert_complete(suggestion: dict[str, Any]) -> None:
    assert suggestion["id"] > 0
    assert set(suggestion["params"]) == PARAMS[suggestion["primitive"]]
    assert all(math.isfinite(v) for v in suggestion["params"].values())
    assert set(suggestion["params_std"]) <= set(suggestion["params"])
    assert all(math.isfinite(v) and v >= 0.0 for v in suggestion["params_std"].values())
    path = suggestion["path"]
    assert len(path) >= 2
    assert all(len(point) == 4 and all(math.isfinite(v) for v in point) for point in path)
    steps = [math.dist(a[:3], b[:3]) for a, b in pairwise(path)]
    assert max(steps) < 0.25
    assert 0.0 <= suggestion["confidence"] <= 1.0
    assert suggestion["fit_rms"] >= 0.0
    assert 0.3 <= suggestion["speed"] <= 1.0
    assert suggestion["heading_sector"] in range(8)
    shortened = "ends after" in suggestion.get("note", "")
    assert suggestion["closed"] == (suggestion["primitive"] == "arc" and not shortened)


def test_a_flown_curve_becomes_the_circle_it_is_part_of(
    service: Process, client: Client, streams: Streams
) -> None:
    sense = -1.0
    streams.add("pose", POSE_RATE_HZ, on_circle(sense))
    poses = client.collect("pose")
    suggestion = suggestion_after(client, "arc")
    newest = poses[-1]["position"]
    assert_complete(suggestion)
    assert suggestion["primitive"] == "arc"
    params = suggestion["params"]
    assert math.dist((params["cx"], params["cy"]), CENTRE) < 0.05
    assert params["radius"] == pytest.approx(RADIUS, rel=0.02)
    assert params["z"] == pytest.approx(HEIGHT, abs=0.01)
    assert params["sweep"] * sense > 0.0
    path = suggestion["path"]
    assert math.dist(path[0][:3], newest) < 0.1
    assert math.dist(path[0][:3], path[-1][:3]) < 0.05
    for x, y, z, yaw in path:
        assert math.dist((x, y), CENTRE) == pytest.approx(RADIUS, abs=0.05)
        assert z == pytest.approx(HEIGHT, abs=0.02)
        tangent = math.atan2(y - CENTRE[1], x - CENTRE[0]) + sense * math.pi / 2.0
        assert abs(math.remainder(yaw - tangent, 2.0 * math.pi)) < 0.1
    assert suggestion["speed"] == pytest.approx(SPEED, abs=0.1)
    assert suggestion["heading_sector"] == 0
    assert suggestion["fit_rms"] < 0.02
    assert suggestion["confidence"] > 0.6


def test_a_line_flown_sideways_has_its_sector(
    service: Process, client: Client, streams: Streams
) -> None:
    streams.add("pose", POSE_RATE_HZ, on_line(heading=2.0, yaw=2.0 - math.pi / 2.0))
    suggestion = suggestion_after(client, "line", flown_s=1.4)
    assert_complete(suggestion)
    assert suggestion["params"]["heading"] == pytest.approx(2.0, abs=0.02)
    assert suggestion["params"]["climb"] == pytest.approx(0.0, abs=0.02)
    assert suggestion["heading_sector"] == 2
    first, last = suggestion["path"][0], suggestion["path"][-1]
    assert math.dist(first[:3], last[:3]) == pytest.approx(20.0, abs=0.2)


def test_a_climbing_turn_becomes_a_helix(
    service: Process, client: Client, streams: Streams
) -> None:
    streams.add("pose", POSE_RATE_HZ, on_circle(1.0, climb_mps=0.2))
    suggestion = suggestion_after(client, "helix")
    assert_complete(suggestion)
    pitch = 0.2 * 2.0 * math.pi * RADIUS / SPEED
    assert suggestion["params"]["pitch"] == pytest.approx(pitch, rel=0.05)
    climbed = suggestion["path"][-1][2] - suggestion["path"][0][2]
    assert climbed == pytest.approx(3.0 * pitch, rel=0.05)


def test_ids_follow_the_meaning_seq_rises_unknown_fields_are_ignored_and_health_counts(
    service: Process, client: Client, streams: Streams
) -> None:
    streams.add(
        "pose", POSE_RATE_HZ, lambda t: {**on_line(0.0, 0.0)(t), "flavour": "new", "more": [1]}
    )
    suggestions = client.collect("suggestion")
    seen = len(suggestions)
    suggestion_after(client, "line", flown_s=1.2)
    time.sleep(0.2)
    client.put("intent", msgpack.packb(with_unknown_fields("Intent")))
    health = client.next(f"health/{SERVICE}", lambda h: h["rates"]["pose"] > 0.8 * POSE_RATE_HZ)
    assert len(suggestions) == seen + 2
    # The second one means the same as the first: its path is newer, its number is not.
    ids = [suggestion["id"] for suggestion in suggestions]
    assert ids[-1] == ids[-2] > 0
    assert suggestions[-1]["path"][0][0] > suggestions[-2]["path"][0][0]
    seqs = [suggestion["seq"] for suggestion in suggestions]
    assert all(b == a + 1 for a, b in pairwise(seqs))
    assert set(suggestions.encodings) == {"application/msgpack;Suggestion/1"}
    assert health["state"] == "ok"
    assert set(health["rates"]) == set(health["rejected"]) == {"pose", "intent", "vehicle"}
    assert 0.0 < health["latency_p50"] <= health["latency_p99"] < 0.1
    assert set(client.collect(f"health/{SERVICE}").encodings) == {"application/msgpack;Health/1"}


def test_it_says_why_it_suggests_nothing(
    service: Process, client: Client, streams: Streams
) -> None:
    streams.add("pose", POSE_RATE_HZ, lambda _: pose(0.0, 0.0, 1.0, 0.0))
    time.sleep(0.5)
    assert_no_suggestion(client, intent("none"), "none")
    assert_no_suggestion(client, intent("line"), "moved only")
    streams.close()
    time.sleep(0.3)
    assert_no_suggestion(client, intent("line"), "old")
    streams.add("pose", POSE_RATE_HZ, lambda _: pose(0.0, 0.0, 1.0, 0.0, status="lost"))
    time.sleep(0.3)
    assert_no_suggestion(client, intent("line"), "lost")


def test_a_circle_ends_before_the_wall_that_stands_in_it(
    service: Process, client: Client, streams: Streams
) -> None:
    # The circle's far side lies behind the fence of the track at y = 1.5 m.
    centre = (5.0, 1.0)

    def at(t_s: float) -> dict[str, Any]:
        angle = SPEED * t_s / RADIUS - math.pi
        x, y = centre[0] + RADIUS * math.cos(angle), centre[1] + RADIUS * math.sin(angle)
        return pose(x, y, HEIGHT, angle + math.pi / 2.0)

    status = {"state": "flying", "battery": 0.9, "plant": "tum", "collisions": 0}
    streams.add("vehicle", 10.0, lambda _: {**status, "world": "track"})
    streams.add("pose", POSE_RATE_HZ, at)
    suggestion = suggestion_after(client, "arc", flown_s=2.0)
    assert_complete(suggestion)
    assert not suggestion["closed"]
    assert "fence" in suggestion["note"]
    assert max(point[1] for point in suggestion["path"]) < 1.5 - 0.27
    streams.close()
    streams.add("vehicle", 10.0, lambda _: {**status, "world": "empty"})
    time.sleep(0.3)


def points_of(primitive: str) -> list[list[float]]:
    ways = [i / 89.0 for i in range(90)]
    if primitive == "line":
        return [[-3.0 * w, 1.0, 2.0 + 3.0 * w] for w in ways]
    if primitive == "sine":
        return [[4.0 * w, 0.4 * math.sin(2.0 * math.pi * 1.5 * w), 1.0] for w in ways]
    pitch = 0.8 if primitive == "helix" else 0.0
    return [
        [2.0 * math.cos(4.0 * w), -2.0 * math.sin(4.0 * w), 1.0 + pitch * 4.0 * w / 2.0 / math.pi]
        for w in ways
    ]


@pytest.mark.parametrize("primitive", list(PARAMS))
def test_fit_answers_with_the_primitive_through_the_points(
    service: Process, client: Client, primitive: str
) -> None:
    points = points_of(primitive)
    ok, reply = client.ask(
        "synthesis/fit", {"primitive": primitive, "points": points, "speed": 0.7}
    )
    assert ok, reply
    assert_complete(reply)
    assert reply["primitive"] == primitive
    assert reply["speed"] == pytest.approx(0.7)
    assert math.dist(reply["path"][0][:3], points[-1]) < 1e-6
    assert reply["fit_rms"] < 0.01
    expected = {
        "line": {"heading": math.pi, "climb": math.pi / 4.0},
        "arc": {"cx": 0.0, "cy": 0.0, "z": 1.0, "radius": 2.0},
        "helix": {"cx": 0.0, "cy": 0.0, "radius": 2.0, "pitch": 0.8},
        "sine": {"heading": 0.0, "amplitude": 0.4, "wavelength": 4.0 / 1.5, "z": 1.0},
    }[primitive]
    for name, value in expected.items():
        difference = reply["params"][name] - value
        if name == "heading":
            difference = math.remainder(difference, 2.0 * math.pi)
        assert difference == pytest.approx(0.0, abs=0.01), name
    if "sweep" in reply["params"]:
        assert reply["params"]["sweep"] < 0.0
    # It goes on: the first step is not back over the points.
    step = [b - a for a, b in zip(points[-2], points[-1], strict=True)]
    first = [b - a for a, b in zip(reply["path"][0][:3], reply["path"][1][:3], strict=True)]
    assert sum(a * b for a, b in zip(step, first, strict=True)) > 0.0


def test_fit_takes_the_speed_into_its_limits_and_says_so(service: Process, client: Client) -> None:
    request = {"primitive": "line", "points": points_of("line")}
    fast = client.ask("synthesis/fit", {**request, "speed": 9.0})[1]
    assert fast["speed"] == 1.0
    assert "9" in fast["note"]
    plain = client.ask("synthesis/fit", request)[1]
    assert 0.3 <= plain["speed"] <= 1.0
    assert "note" not in plain


@pytest.mark.parametrize(
    ("request_", "field"),
    [
        ({"primitive": "loop", "points": points_of("arc")}, "primitive"),
        ({"primitive": "arc", "points": points_of("line")}, "points"),
        ({"primitive": "line", "points": [[1.0, 1.0, 1.0]] * 20}, "points"),
        ({"primitive": "line", "points": [[1.0, 1.0, 1.0]]}, "points"),
        ({"primitive": "line", "points": [[0.0, 0.0, float("nan")]] * 9}, "points"),
        ({"primitive": "line", "points": "many"}, "points"),
        ({"primitive": "line", "points": points_of("line"), "speed": -1.0}, "speed"),
        ({"primitive": "line"}, "points"),
        ({"points": points_of("line")}, "primitive"),
    ],
)
def test_a_bad_fit_is_refused_with_its_field(
    service: Process, client: Client, request_: dict[str, Any], field: str
) -> None:
    ok, reply = client.ask("synthesis/fit", request_)
    assert not ok
    assert reply["field"] == field
    assert reply["error"]


@pytest.mark.parametrize("payload", [b"\x01\x02", b"", msgpack.packb([1, 2])])
def test_a_fit_that_is_no_request_is_refused(
    service: Process, client: Client, payload: bytes
) -> None:
    ok, reply = client.ask("synthesis/fit", payload)
    assert not ok
    assert reply["error"]


@pytest.mark.parametrize(("topic", "message"), [("pose", "Pose"), ("intent", "Intent")])
def test_bad_input_is_dropped_and_counted(
    service: Process, client: Client, topic: str, message: str
) -> None:
    assert_bad_input_is_dropped_and_counted(client, SERVICE, topic, message)


def test_it_stops_cleanly_on_sigterm(launch: Launch, client: Client, service: Process) -> None:
    assert service.stop() == 0, service.log.read_text()
    assert SERVICE not in client.alive()
    assert "Traceback" not in service.log.read_text()


def test_it_starts_before_its_router(tmp_path: Path) -> None:
    assert_starts_before_its_router(SERVICE, tmp_path=tmp_path)


def test_it_stops_while_it_waits_for_its_router(tmp_path: Path) -> None:
    assert_stops_without_a_router(SERVICE, tmp_path=tmp_path)
