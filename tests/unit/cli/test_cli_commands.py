"""The commands as a person runs them: processes, a real router, exit codes and what they print."""

import ctypes
import json
import platform
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from mcap.reader import make_reader

from common import messages as m
from common.topics import TOPICS, Delivery, alive_key_of, key_of
from common.zenoh_bus import ZenohBus, router_config

VEHICLE = "cli-test"
COMMAND = str(Path(sys.executable).with_name("autocomplete"))
TIMEOUT_S = 20.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def run(*words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [COMMAND, *words], capture_output=True, text=True, timeout=TIMEOUT_S, cwd=cwd, check=False
    )


@pytest.fixture(scope="module")
def network() -> Iterator[list[str]]:
    """The flags that lead to a small system: a pose at 50 Hz, pictures, a token, health."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    stop = threading.Event()
    with zenoh.open(router_config(endpoint)):
        bus = ZenohBus(endpoint)
        publications = {
            name: bus.publication(
                key_of(VEHICLE, name),
                Delivery.STREAM,
                m.encoding_of(TOPICS[name].message),
                video=TOPICS[name].is_video,
            )
            for name in ("pose", "camera/front", "health/localizer", "imu")
        }
        bus.announce(alive_key_of(VEHICLE, "localizer"))

        def publish() -> None:
            seq = 0
            while not stop.wait(0.02):
                seq += 1
                publications["pose"].put(m.encode(pose(seq)))
                publications["camera/front"].put(m.encode(picture(seq)))
                publications["imu"].put(b"no payload at all")
                if seq % 25 == 0:
                    publications["health/localizer"].put(m.encode(health(seq)))

        publisher = threading.Thread(target=publish)
        publisher.start()
        yield ["--connect", endpoint, "--vehicle", VEHICLE]
        stop.set()
        publisher.join()
        bus.close()


def pose(seq: int) -> m.Pose:
    return m.Pose(
        stamp=seq,
        seq=seq,
        position=(1.0, 2.0, 3.0),
        orientation=(0.0, 0.0, 0.0, 1.0),
        velocity=(0.0, 0.0, 0.0),
        angular_velocity=(0.0, 0.0, 0.0),
        covariance=(0.0,) * 6,
        status="ok",
        source="test",
    )


def picture(seq: int) -> m.Image:
    return m.Image(
        stamp=seq,
        seq=seq,
        width=4,
        height=3,
        format="jpeg",
        data=bytes(1000),
        intrinsics=(1.0, 1.0, 1.0, 1.0),
        distortion=(0.0, 0.0, 0.0, 0.0),
        capture=seq,
    )


def health(seq: int) -> m.Health:
    return m.Health(
        stamp=seq,
        seq=seq,
        service="localizer",
        version="0",
        state="ok",
        detail="all well",
        rates={},
        rejected={},
        latency_p50=0.0,
        latency_p99=0.0,
    )


def test_topics_as_json_has_every_row_with_its_rate(network: list[str]) -> None:
    done = run("topics", "--json", *network)
    assert done.returncode == 0, done.stderr
    snapshot = json.loads(done.stdout)
    assert snapshot["alive"] == ["localizer"]
    rows = {row["topic"]: row for row in snapshot["topics"]}
    assert set(rows) == set(TOPICS)
    assert rows["pose"]["rate_hz"] == pytest.approx(49.0, abs=6.0)
    assert rows["pose"]["age_s"] < 0.3
    assert rows["camera/front"]["bytes_per_s"] > 30_000
    assert rows["stick"]["rate_hz"] == 0
    assert rows["stick"]["age_s"] is None


def test_topics_once_is_a_table(network: list[str]) -> None:
    done = run("topics", "--once", *network)
    assert done.returncode == 0, done.stderr
    for name in TOPICS:
        assert name in done.stdout


def test_echo_prints_a_message_a_line_and_ends_after_count(network: list[str]) -> None:
    done = run("echo", "pose", "--count", "3", *network)
    assert done.returncode == 0, done.stderr
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    assert [message["position"] for message in messages] == [[1.0, 2.0, 3.0]] * 3
    assert messages[1]["seq"] == messages[0]["seq"] + 1


def test_echo_summarises_pictures(network: list[str]) -> None:
    done = run("echo", "camera/front", "--count", "1", *network)
    assert json.loads(done.stdout)["data"] == "<1000 bytes>"


def test_echo_ends_quietly_when_its_reader_leaves(network: list[str]) -> None:
    words = " ".join([COMMAND, "echo", "pose", *network])
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{words} | head -2"],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert len(done.stdout.splitlines()) == 2
    assert done.stderr == ""


def test_echo_tells_what_is_wrong_with_an_invalid_payload(network: list[str]) -> None:
    words = [COMMAND, "echo", "imu", *network]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "invalid payload of 17 bytes" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(TIMEOUT_S) == 0


def test_alive_is_the_exit_code_of_a_health_check(network: list[str]) -> None:
    done = run("alive", "localizer", *network)
    assert (done.returncode, done.stdout) == (0, "localizer: ok all well\n")
    done = run("alive", "sim", *network)
    assert done.returncode == 1
    assert "sim of cli-test is silent" in done.stderr


def test_record_writes_what_flies_for_as_long_as_told(network: list[str], tmp_path: Path) -> None:
    path = tmp_path / "made" / "flight.mcap"
    done = run("record", "--seconds", "1.5", "--output", str(path), *network)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(path)
    with path.open("rb") as stream:
        counts: dict[str, int] = {}
        for _, channel, _ in make_reader(stream).iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    assert set(counts) == {"pose", "camera/front", "health/localizer"}
    assert counts["pose"] > 30
    again = run("record", "--seconds", "1", "--output", str(path), *network)
    assert again.returncode == 1
    assert "is there already" in again.stderr


def test_record_ends_with_a_whole_file_when_interrupted(network: list[str], tmp_path: Path) -> None:
    words = [COMMAND, "record", *network]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        time.sleep(2.0)
        process.send_signal(signal.SIGINT)
        assert process.wait(TIMEOUT_S) == 0
    (path,) = (tmp_path / "recordings").glob(f"{VEHICLE}-*.mcap")
    with path.open("rb") as stream:
        assert make_reader(stream).get_summary().statistics.message_count > 10


def test_without_a_router_a_command_says_so_and_fails(network: list[str]) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    done = run("echo", "pose", "--connect", endpoint)
    assert done.returncode == 1
    assert f"no router at {endpoint}; start one" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_router_routes_between_two_clients_and_stops_on_sigterm() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with subprocess.Popen([COMMAND, "router", "--listen", endpoint]) as process:
        reader, writer = ZenohBus(endpoint), ZenohBus(endpoint)
        heard: list[bytes] = []
        reader.subscribe("a/b", heard.append)
        publication = writer.publication("a/b", Delivery.EVENT, "")
        deadline = time.monotonic() + 5.0
        while not heard and time.monotonic() < deadline:
            publication.put(b"hello")
            time.sleep(0.02)
        assert heard
        process.send_signal(signal.SIGTERM)
        assert process.wait(5.0) == 0
        reader.close()
        writer.close()


@pytest.mark.skipif(platform.machine() != "x86_64", reason="a system call is known by number")
def test_a_router_says_where_it_listens_and_hears_a_signal_that_another_thread_took() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    words = [COMMAND, "router", "--listen", endpoint]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert endpoint in process.stderr.readline()
        threads = [int(task.name) for task in Path(f"/proc/{process.pid}/task").iterdir()]
        tgkill = 234
        assert ctypes.CDLL(None).syscall(tgkill, process.pid, max(threads), signal.SIGTERM) == 0
        assert process.wait(TIMEOUT_S) == 0


def test_a_router_takes_a_configuration_file(tmp_path: Path) -> None:
    port = free_port()
    text = (Path(__file__).parents[3] / "deploy/zenoh.json5").read_text()
    (tmp_path / "zenoh.json5").write_text(text.replace(":7447", f":{port}"))
    words = [COMMAND, "router", "--config", str(tmp_path / "zenoh.json5")]
    with subprocess.Popen(words) as process:
        bus = ZenohBus(f"tcp/127.0.0.1:{port}")
        assert bus.linked()
        bus.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(5.0) == 0


def test_a_router_whose_port_is_taken_says_so(network: list[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        done = run("router", "--listen", f"tcp/127.0.0.1:{taken.getsockname()[1]}")
    assert done.returncode == 1
    assert done.stderr.startswith("autocomplete router: cannot listen on tcp/127.0.0.1:")
    assert "--listen" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_doctor_looks_at_everything_and_finds_the_router(network: list[str]) -> None:
    done = run("doctor", *network)
    assert done.returncode in (0, 1)
    for subject in ("Python", "OpenGL", "Node.js", "Chromium", "Docker", "port 7447", "recorder"):
        assert re.search(rf"(ok|note|warn|fail) +.*{subject}", done.stdout), done.stdout
    assert re.search(rf"ok +router +{network[1]}", done.stdout)
    assert "localizer alive" in done.stdout
