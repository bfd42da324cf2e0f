"""The recorder: what is published is in the file, as MCAP that any reader opens."""

import base64
import json
import resource
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh
from conftest import (
    Client,
    Launch,
    Streams,
    assert_starts_before_its_router,
    assert_stops_without_a_router,
    start_service,
)
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from payloads import GOOD, STAMP, bad_payloads, with_unknown_fields

MESSAGE_OF = {
    "stick": "Stick",
    "intent": "Intent",
    "suggestion": "Suggestion",
    "autopilot": "AutopilotStatus",
    "command": "Command",
    "pose": "Pose",
    "truth": "Pose",
    "imu": "Imu",
    "altimeter": "Range",
    "camera/front": "Image",
    "overlay/front": "Image",
    "vehicle": "VehicleStatus",
    "health/sim": "Health",
}
NOT_RECORDED = {"camera/down": "Image", "console/stick": "Stick"}
PICTURES = {"camera/front", "overlay/front"}


def only_file(folder: Path) -> Path:
    (path,) = folder.glob("*.mcap")
    return path


def read(path: Path) -> dict[str, list[tuple[Any, Any, dict[str, Any]]]]:
    """Schema, message and decoded JSON by topic."""
    found: dict[str, list[tuple[Any, Any, dict[str, Any]]]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            row = (schema, message, json.loads(message.data))
            assert channel.message_encoding == "json"
            found.setdefault(channel.topic, []).append(row)
    return found


def wait_for_detail(client: Client, part: str) -> dict[str, Any]:
    return client.next("health/recorder", lambda health: part in health["detail"])


def test_everything_that_is_recorded_comes_back(
    launch: Launch, client: Client, tmp_path: Path, vehicle: str
) -> None:
    process = start_service(launch, client, "recorder", "--folder", str(tmp_path))
    client.next("health/recorder")
    begin_ns = time.time_ns()
    for seq in range(20):
        for topic, message in (MESSAGE_OF | NOT_RECORDED).items():
            client.put(topic, msgpack.packb({**GOOD[message], "seq": seq, "stamp": STAMP + seq}))
        time.sleep(0.01)
    client.put("pose", msgpack.packb({**with_unknown_fields("Pose"), "seq": 20}))
    client.next("health/recorder", lambda h: f" {20 * len(MESSAGE_OF)} " < h["detail"])
    time.sleep(0.3)
    end_ns = time.time_ns()
    assert process.stop() == 0, process.log.read_text()

    path = only_file(tmp_path)
    assert path.name.startswith(f"{vehicle}-")
    found = read(path)
    assert set(found) - {"health/recorder"} == set(MESSAGE_OF)
    for topic, message in MESSAGE_OF.items():
        rows = found[topic]
        assert [row[2]["seq"] for row in rows[:20]] == list(range(20)), topic
        for seq, (schema, record, content) in enumerate(rows[:20]):
            assert schema.encoding == "jsonschema"
            assert record.publish_time == STAMP + seq
            assert begin_ns <= record.log_time <= end_ns
            sent = {**GOOD[message], "seq": seq, "stamp": STAMP + seq}
            if topic in PICTURES:
                assert schema.name == "foxglove.CompressedImage"
                assert base64.b64decode(content.pop("data")) == sent.pop("data")
                seconds, rest = divmod(GOOD["Image"]["capture"], 10**9)
                assert content.pop("timestamp") == {"sec": seconds, "nsec": rest}
                assert content.pop("frame_id") == topic
            else:
                assert schema.name == message
            assert content == sent
            properties = json.loads(schema.data)["properties"]
            assert set(json.loads(record.data)) <= set(properties), topic
            assert json.loads(schema.data)["type"] == "object"
            assert b"$ref" not in schema.data
    assert found["pose"][20][2] == {**GOOD["Pose"], "seq": 20}, "unknown fields are left out"


def test_bad_input_is_dropped_and_counted_and_never_recorded(
    launch: Launch, client: Client, tmp_path: Path
) -> None:
    process = start_service(launch, client, "recorder", "--folder", str(tmp_path))
    client.next("health/recorder")
    expected = {}
    for topic, message in MESSAGE_OF.items():
        bad = [payload for _, payload in bad_payloads(message)]
        expected[topic] = len(bad)
        for payload in bad:
            client.put(topic, payload)
            time.sleep(0.002)
        client.put(topic, msgpack.packb(GOOD[message]))
    health = client.next(
        "health/recorder",
        lambda h: all(h["rejected"][topic] >= count for topic, count in expected.items()),
    )
    assert {topic: health["rejected"][topic] for topic in expected} == expected
    assert health["state"] == "ok"
    assert process.stop() == 0
    found = read(only_file(tmp_path))
    assert {topic: len(found[topic]) for topic in MESSAGE_OF} == dict.fromkeys(MESSAGE_OF, 1)


def test_health_and_token_say_that_it_records(
    launch: Launch, client: Client, streams: Streams, tmp_path: Path
) -> None:
    process = start_service(launch, client, "recorder", "--folder", str(tmp_path / "made" / "here"))
    streams.add("pose", 50.0, lambda _: {k: v for k, v in GOOD["Pose"].items() if k != "seq"})
    health = client.next("health/recorder", lambda h: h["rates"]["pose"] > 40.0)
    assert health["service"] == "recorder"
    assert health["state"] == "ok"
    assert ".mcap" in health["detail"]
    assert 0.0 < health["latency_p50"] <= health["latency_p99"] < 0.1
    collected = client.collect("health/recorder")
    time.sleep(2.2)
    assert collected.encodings[-1] == "application/msgpack;Health/1"
    assert collected[-1]["seq"] - collected[-2]["seq"] == 1
    assert process.stop() == 0
    assert "recorder" not in client.alive()


def test_a_killed_recorder_leaves_what_it_wrote(
    launch: Launch, client: Client, streams: Streams, tmp_path: Path
) -> None:
    flags = ("--folder", str(tmp_path), "--chunk-bytes", "4096", "--compression", "lz4")
    process = start_service(launch, client, "recorder", *flags)
    streams.add("pose", 200.0, lambda _: {k: v for k, v in GOOD["Pose"].items() if k != "seq"})
    time.sleep(2.0)
    process.popen.send_signal(signal.SIGKILL)
    process.popen.wait(5.0)
    topics: list[str] = []
    channels: dict[int, str] = {}
    with only_file(tmp_path).open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                name = type(record).__name__
                if name == "Channel":
                    channels[record.id] = record.topic
                elif name == "Message":
                    topics.append(channels[record.channel_id])
        except McapError:
            pass
    assert topics.count("pose") > 200


def test_a_full_disk_is_told_in_health_and_ends_nothing(
    launch: Launch, client: Client, streams: Streams, tmp_path: Path
) -> None:
    flags = ("--folder", str(tmp_path), "--chunk-bytes", "4096")
    process = start_service(launch, client, "recorder", *flags)
    # No file of this process may grow beyond 8 kB: a disk that is full.
    limits = resource.prlimit(process.popen.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(process.popen.pid, resource.RLIMIT_FSIZE, (8192, limits[1]))
    streams.add("imu", 200.0, lambda t: {**GOOD["Imu"], "seq": int(t * 1e6)})
    health = client.next("health/recorder", lambda h: h["state"] == "failed")
    assert "takes no more: File too large" in health["detail"]
    assert client.next("health/recorder")["rates"]["imu"] > 100.0, "it goes on listening"
    resource.prlimit(process.popen.pid, resource.RLIMIT_FSIZE, limits)
    assert process.stop() == 0
    assert "Traceback" not in process.log.read_text()


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (("--folder", "/dev/null/recordings"), "choose another folder"),
        (("--compression", "zip"), "compression"),
        (("--chunk-bytes", "1"), "use 1024 to"),
        (("--folder", ""), "'folder': is empty"),
    ],
)
def test_what_cannot_work_is_one_line_on_stderr(
    router: zenoh.Session, launch: Launch, flags: tuple[str, ...], complaint: str
) -> None:
    process = launch("recorder", *flags)
    assert process.popen.wait(10.0) in (1, 2)
    text = process.log.read_text()
    assert complaint in text
    assert "Traceback" not in text
    assert len([line for line in text.splitlines() if not line.startswith("{")]) == 1


def test_it_starts_before_its_router(tmp_path: Path) -> None:
    assert_starts_before_its_router("recorder", "--folder", str(tmp_path), tmp_path=tmp_path)


def test_it_stops_without_a_router(tmp_path: Path) -> None:
    assert_stops_without_a_router("recorder", "--folder", str(tmp_path), tmp_path=tmp_path)


def test_it_stops_at_once_when_asked_by_the_keyboard(
    launch: Launch, client: Client, tmp_path: Path
) -> None:
    process = start_service(launch, client, "recorder", "--folder", str(tmp_path))
    process.popen.send_signal(signal.SIGINT)
    try:
        assert process.popen.wait(4.0) == 0
    except subprocess.TimeoutExpired:
        pytest.fail("SIGINT did not end it")
    assert read(only_file(tmp_path)) is not None
