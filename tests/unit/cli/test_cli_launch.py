"""A whole system on one machine: what is seen to before it starts, how it ends, what it leaves."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cli import launch
from cli.launch import System, SystemFailedError, free_port, last_words, running
from common.config import ConfigError

COMMAND = str(Path(sys.executable).with_name("autocomplete"))
TIMEOUT_S = 20.0


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[str, ...]]:
    """The words of each process that would have been started; logs go to a folder of the test."""
    words: list[tuple[str, ...]] = []
    monkeypatch.setattr(System, "start", lambda _, *these: words.append(these))
    monkeypatch.setattr(launch.tempfile, "mkdtemp", lambda prefix: str(tmp_path / prefix))
    (tmp_path / "autocomplete-").mkdir()
    return words


def test_a_configuration_that_cannot_be_used_is_told_before_anything_starts(
    started: list[tuple[str, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "system.toml"
    file.write_text("[overlay]\njpeg_quality = 0\n")
    with pytest.raises(ConfigError, match="jpeg_quality"), running(["overlay"], {}, "x", file):
        pass
    with pytest.raises(ConfigError, match="seed"), running(["sim"], {"sim": {"seed": "-1"}}):
        pass
    monkeypatch.setenv("AUTOCOMPLETE_SIM_WORLD", "nowhere")
    with pytest.raises(ConfigError, match="nowhere"), running(["sim"], {}):
        pass
    assert started == []


def test_a_console_port_that_is_taken_is_told_before_anything_starts(
    started: list[tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launch, "is_free", lambda _: False)
    with (
        pytest.raises(ValueError, match="--console-port: port 8099 is taken"),
        running(["overlay"], {"overlay": {"console_port": 8099}}),
    ):
        pass
    assert started == []


def test_a_file_sets_what_nobody_typed(started: list[tuple[str, ...]], tmp_path: Path) -> None:
    port = free_port()
    file = tmp_path / "system.toml"
    file.write_text(f"[overlay]\nconsole_port = {port}\n")
    settings = {"overlay": {"console_port": None, "below_m": 0.5}}
    with running(["overlay"], settings, "x", file) as system:
        assert system.console == f"http://localhost:{port}"
        assert system.configs["overlay"].below_m == 0.5
    _, overlay = started
    assert "--below-m=0.5" in overlay
    assert not any(word.startswith("--console-port") for word in overlay)


def test_logs_are_removed_after_a_clean_end_alone(
    started: list[tuple[str, ...]], tmp_path: Path
) -> None:
    with pytest.raises(SystemFailedError), running([], {}):
        raise SystemFailedError("the lap was not flown")
    assert (tmp_path / "autocomplete-").is_dir()
    with running([], {}):
        pass
    assert not (tmp_path / "autocomplete-").exists()


@pytest.mark.parametrize(
    ("log", "words"),
    [
        ("", "no word"),
        ("first\nlast\n\n", "last"),
        ("autocomplete run: operator: no screen\n", "operator: no screen"),
        ('{"level": "info", "message": "sim is up"}\n', "sim is up"),
        (
            json.dumps({"message": "sim failed", "exception": "Traceback\n  x\nOSError: full"}),
            "sim failed: OSError: full",
        ),
        ("[1, 2]", "[1, 2]"),
    ],
)
def test_of_a_log_a_person_is_told_the_last_words(log: str, words: str) -> None:
    assert last_words(log) == words


def test_the_end_of_a_process_is_told_in_one_line(tmp_path: Path) -> None:
    system = System("tcp/127.0.0.1:1", "x", tmp_path, {})
    system.start("router", "router", "--listen", "nowhere")
    system.processes["router"].wait(TIMEOUT_S)
    with pytest.raises(SystemFailedError) as failed:
        system.check()
    system.stop()
    text = str(failed.value)
    assert text.startswith("router ended with code 2: ")
    assert "'nowhere' is no endpoint" in text
    assert str(tmp_path / "router.log") in text
    assert "\n" not in text


def test_processes_end_with_the_one_that_started_them_even_if_that_is_killed(
    tmp_path: Path,
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    script = (
        "import pathlib, time; from cli.launch import System;"
        f" s = System('{endpoint}', 'x', pathlib.Path('{tmp_path}'), {{}});"
        f" s.start('router', 'router', '--listen', '{endpoint}');"
        " print(s.processes['router'].pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as starter:
        assert starter.stdout is not None
        pid = int(starter.stdout.readline())
        assert is_running(pid)
        starter.kill()
    deadline = time.monotonic() + TIMEOUT_S
    while is_running(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(pid)


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        # Without an init that reaps, an orphan that has ended stays as a zombie.
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def test_a_closed_terminal_stops_a_process_in_order() -> None:
    endpoint = f"tcp/127.0.0.1:{(port := free_port())}"
    # Tests under nohup would hand on that the signal is to be survived.
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        process = subprocess.Popen([COMMAND, "router", "--listen", endpoint])
    finally:
        signal.signal(signal.SIGHUP, before)
    try:
        deadline = time.monotonic() + TIMEOUT_S
        while launch.is_free(port) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGHUP)
        assert process.wait(TIMEOUT_S) == 0
    finally:
        process.kill()
        process.wait()
