"""`autocomplete dataset record` beside a real operator service: hands to a file."""

import json
import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import Client, Launch, start_service

COMMAND = str(Path(sys.executable).with_name("autocomplete"))


@pytest.fixture(scope="module")
def operator(launch: Launch, client: Client) -> None:
    start_service(launch, client, "operator", "--source", "console")


class Record:
    """The command, collecting; what it writes to stderr goes beside its set."""

    def __init__(self, port: int, vehicle: str, out: Path, label: str, count: int) -> None:
        self._log = out.with_name(f"{label}.log")
        with self._log.open("w") as log:
            self.popen = subprocess.Popen(
                [
                    *(COMMAND, "dataset", "record", "--label", label, "--operator", "ana"),
                    *("--count", str(count), "--out", str(out)),
                    *("--vehicle", vehicle, "--connect", f"tcp/127.0.0.1:{port}"),
                ],
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )

    def wait_told(self, text: str) -> None:
        deadline = time.monotonic() + 15.0
        while text not in (told := " ".join(self._log.read_text().split())):
            assert time.monotonic() < deadline, told
            time.sleep(0.05)

    def end(self) -> str:
        told, _ = self.popen.communicate(timeout=15.0)
        assert self.popen.returncode == 0, self._log.read_text()
        return told


Start = Callable[[str, Path, str, int], Record]


@pytest.fixture
def start(port: int) -> Iterator[Start]:
    """Starts the command; none outlives the test."""
    started: list[Record] = []

    def record(vehicle: str, out: Path, label: str, count: int) -> Record:
        started.append(Record(port, vehicle, out, label, count))
        return started[-1]

    yield record
    for each in started:
        if each.popen.poll() is None:
            each.popen.kill()
            each.popen.wait()


class Hands:
    """A browser's pad in the hands of somebody."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def _hold(self, seconds: float, deflection: float, buttons: list[str] | None = None) -> None:
        begin = time.monotonic()
        while (t_s := time.monotonic() - begin) < seconds:
            sticks = {
                "vx": deflection * math.cos(2.0 * t_s),
                "vy": deflection * math.sin(2.0 * t_s),
                "vz": 0.0,
                "wz": 0.0,
            }
            held = {} if buttons is None else {"buttons": buttons}
            self._client.publish("console/stick", {**sticks, **held})
            time.sleep(0.02)

    def perform(self, seconds: float) -> None:
        """A circle, a moment of rest, and the end."""
        self._hold(0.1, 0.0)
        self._hold(seconds, 0.6)
        self._hold(0.2, 0.0)
        self.mark()

    def mark(self) -> None:
        # Longer than a busy machine lets a process wait.
        self._hold(0.3, 0.0, ["end"])
        self._hold(0.5, 0.0)


@pytest.fixture
def hands(client: Client, operator: None) -> Hands:
    return Hands(client)


def labels_in(path: Path) -> list[str]:
    with np.load(path) as file:
        assert json.loads(str(file["provenance"]))["made"].startswith("record --label ")
        return file["label"].tolist() if "label" in file else []


def wait_for(path: Path, labels: list[str]) -> None:
    deadline = time.monotonic() + 5.0
    while not path.exists() or labels_in(path) != labels:
        assert time.monotonic() < deadline, path.exists() and labels_in(path)
        time.sleep(0.05)


def test_primitives_are_collected_saved_one_by_one_and_gone_on_with(
    hands: Hands, client: Client, start: Start, vehicle: str, tmp_path: Path
) -> None:
    out = tmp_path / "ana.npz"
    client.next("stick")
    first = start(vehicle, out, "arc", 2)
    first.wait_told("Ctrl-C ends")
    hands.perform(1.6)
    wait_for(out, ["arc"])
    hands.perform(0.4)
    first.wait_told("shorter than 1 s")
    hands.perform(1.8)
    assert first.end() == f"{out}: 2 more, line 0  arc 2  sine 0  helix 0  none 0\n"

    second = start(vehicle, out, "none", 5)
    second.wait_told("Ctrl-C ends")
    hands.perform(1.8)
    wait_for(out, ["arc", "arc", "none"])
    hands.mark()
    wait_for(out, ["arc", "arc"])
    second.popen.send_signal(signal.SIGINT)
    assert second.end() == f"{out}: 0 more, line 0  arc 2  sine 0  helix 0  none 0\n"
    with np.load(out) as file:
        durations_s = file["times_s"][file["offsets"][1:] - 1]
        assert file["operator"].tolist() == ["ana", "ana"]
        assert (np.abs(file["utc_ns"] / 1e9 - time.time()) < 120.0).all()
    np.testing.assert_allclose(durations_s, [1.6, 1.8], atol=0.3)


def test_without_sticks_it_says_what_to_start(start: Start, router: object, tmp_path: Path) -> None:
    record = start("nobody", tmp_path / "ana.npz", "arc", 1)
    record.wait_told("no sticks of nobody: is 'autocomplete up'")
    record.popen.send_signal(signal.SIGINT)
    assert record.end()


def test_a_file_that_is_no_set_is_not_written_over(start: Start, tmp_path: Path) -> None:
    out = tmp_path / "ana.npz"
    out.write_text("something else")
    record = start("nobody", out, "arc", 1)
    assert record.popen.wait(15.0) == 1
    record.wait_told(f"autocomplete dataset: {out} is no data set")
    assert out.read_text() == "something else"
