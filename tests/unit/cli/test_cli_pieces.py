"""The parts of the command line that need no network."""

import argparse
import dataclasses
import io
import threading
from pathlib import Path

import pytest
from rich.console import Console

from cli import doctor, options
from cli.contract import page
from cli.echo import silence, summary
from cli.main import main
from cli.meter import WINDOW_S, Meter
from cli.run import _meanings_in, _service_in
from cli.topics import table_of
from common import messages as m
from common.config import ConfigError
from common.memory_bus import MemoryBus, MemoryNetwork
from common.run import config_type_of
from common.topics import QUERIES, SERVICES, TOPICS

ROOT = Path(__file__).parents[3]


def test_the_page_of_the_contract_is_what_the_code_says() -> None:
    assert (ROOT / "docs/contract.md").read_text() == page(), "run 'make docs'"


def test_the_page_names_every_topic_query_and_field() -> None:
    text = page()
    for topic in TOPICS.values():
        if topic.message is not m.Health:
            assert f"| `{topic.name}` | {topic.message.__name__} | {topic.publisher} |" in text
        for field in topic.message.__struct_fields__:
            assert f"`{field}`" in text
    for query in QUERIES.values():
        assert f"| `{query.name}` |" in text
        for payload in (query.request, query.reply):
            assert f"### {payload.__name__}\n" in text


def test_a_rate_is_that_of_the_window() -> None:
    meter = Meter(0)
    for tick in range(1, 101):
        meter.add(10, tick * 20_000_000)
    now_ns = 2_000_000_000
    assert meter.rate_hz(now_ns) == pytest.approx(50.0, rel=0.02)
    assert meter.bytes_per_s(now_ns) == pytest.approx(500.0, rel=0.02)
    assert meter.age_s(now_ns) == 0.0
    later_ns = now_ns + round((WINDOW_S + 0.1) * 1e9)
    assert meter.rate_hz(later_ns) == 0.0
    assert meter.age_s(later_ns) is None
    assert (meter.count, meter.size_bytes) == (100, 1000)


def test_a_young_meter_does_not_understate() -> None:
    meter = Meter(0)
    for tick in range(1, 26):
        meter.add(1, tick * 20_000_000)
    assert meter.rate_hz(500_000_000) == pytest.approx(50.0)


def test_pictures_are_summarised_and_absent_options_left_out() -> None:
    image = m.Image(
        stamp=1,
        seq=2,
        width=4,
        height=3,
        format="jpeg",
        data=bytes(99),
        intrinsics=(1.0, 1.0, 1.0, 1.0),
        distortion=(0.0, 0.0, 0.0, 0.0),
        capture=1,
    )
    assert summary(image)["data"] == "<99 bytes>"
    stick = m.Stick(stamp=1, seq=2, vx=0.0, vy=0.0, vz=0.0, wz=0.0)
    assert "buttons" not in summary(stick)


@pytest.mark.parametrize(
    ("words", "service"),
    [
        (["sim"], "sim"),
        (["--vehicle", "sim", "localizer"], "localizer"),
        (["--vehicle=sim", "localizer"], "localizer"),
        (["--camera-fps", "30", "sim"], "sim"),
        (["overlay", "--connect", "tcp/sim:1"], "overlay"),
        (["--help"], None),
        ([], None),
    ],
)
def test_the_service_to_run_is_found_among_its_options(
    words: list[str], service: str | None
) -> None:
    assert _service_in(words) == service


@pytest.mark.parametrize("service", SERVICES)
def test_help_says_what_each_setting_of_a_service_means(service: str) -> None:
    config = config_type_of(service)
    meanings = _meanings_in(config)
    assert all(meanings.get(field.name) for field in dataclasses.fields(config))


def test_help_names_what_a_setting_can_be(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "sim", "--help"])
    text = capsys.readouterr().out
    assert "--clock {real,lockstep}" in text
    assert "--gusts {true,false}" in text
    assert "--seed VALUE" in text


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "soon", ""])
def test_a_duration_is_more_than_nothing(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="seconds"):
        options.duration(text)
    assert options.duration("0.5") == 0.5


def test_the_doctor_knows_what_each_extra_installs() -> None:
    assert "mcap" in doctor._requirements_of("recorder")
    assert "torch" in doctor._requirements_of("training")
    assert "torch" not in doctor._requirements_of("classifier")


def test_the_doctor_takes_what_no_flight_needs_for_no_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(doctor, "_is_installed", lambda _: False)
    states = {found.subject: found.state for found in doctor._packages()}
    assert states["packages of sim"] == "warn"
    assert {states[f"packages of {extra}"] for extra in ("training", "test", "check")} == {"note"}


def test_who_waits_for_a_message_is_told_why_none_comes() -> None:
    assert "no localizer of drone9 runs" in silence(TOPICS["pose"], "drone9", is_alive=False)
    assert "runs and has sent none" in silence(TOPICS["suggestion"], "drone0", is_alive=True)


def test_the_table_of_topics_fits_a_terminal_of_80_columns() -> None:
    rows = [
        {
            "topic": topic.name,
            "message": topic.message.__name__,
            "publisher": topic.publisher,
            "nominal_hz": topic.rate_hz,
            "rate_hz": 200.5,
            "age_s": 12.25,
            "bytes_per_s": 12_345_600,
            "count": 1,
        }
        for topic in TOPICS.values()
    ]
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(table_of({"vehicle": "drone0", "alive": ["sim"], "topics": rows}))
    text = console.export_text()
    assert "…" not in text
    assert text.count("12345.6") == len(TOPICS)


def test_the_doctor_says_what_to_do_about_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_is_installed", lambda package: package != "mcap")
    (recorder,) = [f for f in doctor._packages() if f.subject == "packages of recorder"]
    assert (recorder.state, recorder.text) == ("warn", "mcap missing")
    assert "'.[recorder]'" in recorder.mend


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "required"),
        (["fly"], "invalid choice"),
        (["run", "pilot"], "invalid choice"),
        (["run", "sim", "--vehicle", "My Drone"], "use 1 to 32 of"),
        (["run", "sim", "--nonsense", "1"], "unrecognized"),
        (["run", "recorder", "--config", "absent.toml"], "no such file"),
        (["echo", "weather"], "no topic 'weather'"),
        (["echo", "pose", "--count", "0"], "whole number"),
        (["record", "--seconds", "-1"], "more than 0"),
        (["demo", "--console-port", "99999"], "--console-port: '99999': use a port, 1 to 65535"),
        (["up", "--console-port", "-1"], "--console-port: '-1': use a port, 1 to 65535"),
        (["up", "--world", "nowhere"], "--world: no world 'nowhere'; there are"),
        (["up", "--source", "nobody"], "--source: invalid choice"),
        (["demo", "--seed", "x"], "--seed: 'x': use a whole number from 0"),
        (["train", "--seed", "x"], "--seed: 'x': use a whole number from 0"),
        (["router", "--listen", "foo"], "--listen: 'foo' is no endpoint"),
        (["topics", "--connect", "localhost:7447"], "--connect: 'localhost:7447' is no endpoint"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(
    words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    text = capsys.readouterr().err
    assert complaint in text
    assert text.count("\n") == 1


def test_the_figures_as_json_are_those_of_one_lap(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--json"]) == 2
    assert capsys.readouterr().err.startswith("autocomplete demo: --json: ")


@pytest.fixture
def undisturbed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaves pytest its own signals and log."""
    monkeypatch.setattr("cli.router.stop_on_signals", threading.Event)
    monkeypatch.setattr("common.run.stop_on_signals", threading.Event)
    monkeypatch.setattr("common.log.configure", lambda *_: None)


@pytest.mark.usefixtures("undisturbed")
@pytest.mark.parametrize(
    "words", [["router", "--config"], ["run", "recorder", "--zenoh-config"]], ids=" ".join
)
@pytest.mark.parametrize("text", ["{ bad", "{ listen: { endpoints: 3 } }"])
def test_a_file_that_is_none_of_zenohs_is_wrong_usage(
    words: list[str], text: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bad.json5"
    file.write_text(text)
    assert main([*words, str(file)]) == 2
    said = capfd.readouterr().err
    assert said.startswith(f"autocomplete {words[0]}: {file}: no configuration of Zenoh")
    assert "/.cargo/" not in said
    assert said.count("\n") == 1


def test_a_fault_of_the_program_is_one_line_unless_asked_for_more(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> str:
        raise KeyError("pose")

    monkeypatch.setattr("cli.contract.page", fail)
    monkeypatch.delenv("AUTOCOMPLETE_DEBUG", raising=False)
    assert main(["contract"]) == 1
    assert capsys.readouterr().err == (
        "autocomplete contract: KeyError: 'pose' (AUTOCOMPLETE_DEBUG=1 shows where)\n"
    )
    monkeypatch.setenv("AUTOCOMPLETE_DEBUG", "1")
    with pytest.raises(KeyError):
        main(["contract"])


@pytest.mark.usefixtures("undisturbed")
def test_what_a_service_lacks_on_this_machine_is_one_line_and_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def wire(node: object, config: object) -> None:
        raise ConfigError("recorder: no disk")

    monkeypatch.setattr("services.recorder.service.wire", wire)
    monkeypatch.setattr("common.run.open_bus", lambda *_: MemoryBus(MemoryNetwork()))
    assert main(["run", "recorder"]) == 1
    assert capsys.readouterr().err == "autocomplete run: recorder: no disk\n"


def test_every_command_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("run", "router", "topics", "echo", "alive", "doctor", "record", "contract"):
        with pytest.raises(SystemExit) as ended:
            main([command, "--help"])
        assert ended.value.code == 0
        assert f"examples:\n  autocomplete {command}" in capsys.readouterr().out


def test_the_help_of_a_service_lists_its_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "recorder", "--help"])
    text = capsys.readouterr().out
    assert "--chunk-bytes" in text
    assert "(recordings)" in text
