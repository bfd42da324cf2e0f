"""Configuration: file, then environment, then flags; what is wrong is named with its source."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

from common.config import ConfigError, load


@dataclass(frozen=True)
class Example:
    rate_hz: float = 50.0
    world: str = "track"
    loops: int = 3
    noisy: bool = True
    mode: Literal["slow", "fast"] = "slow"
    least: int = 1
    most: int = 5

    def __post_init__(self) -> None:
        if self.rate_hz <= 0:
            raise ValueError(f"rate_hz is {self.rate_hz}; use more than 0")
        if self.least >= self.most:
            raise ValueError("least: must be below most")


def write(folder: Path, text: str) -> Path:
    path = folder / "system.toml"
    path.write_text(text)
    return path


def test_defaults_hold_where_nothing_is_set() -> None:
    assert load(Example, "sim", environment={}) == Example()


def test_flags_win_over_environment_and_environment_over_file(tmp_path: Path) -> None:
    file = write(tmp_path, "[sim]\nrate_hz = 10\nworld = 'file'\nloops = 1\n[overlay]\nport = 1\n")
    environment = {"AUTOCOMPLETE_SIM_WORLD": "env", "AUTOCOMPLETE_SIM_LOOPS": "2"}
    flags = {"loops": "7", "noisy": None}
    config = load(Example, "sim", file, environment, flags)
    assert config == Example(rate_hz=10.0, world="env", loops=7, noisy=True)


@pytest.mark.parametrize(
    ("text", "noisy"), [("true", True), ("false", False), ("0", False), ("1", True)]
)
def test_variables_are_read_as_their_fields_type(text: str, noisy: bool) -> None:
    config = load(Example, "sim", environment={"AUTOCOMPLETE_SIM_NOISY": text})
    assert config.noisy is noisy


def test_variables_of_other_services_and_programs_are_left_alone() -> None:
    environment = {"AUTOCOMPLETE_CONNECT": "x", "AUTOCOMPLETE_OVERLAY_PORT": "1", "SIM_WORLD": "y"}
    assert load(Example, "sim", environment=environment) == Example()


def test_an_unknown_key_is_an_error_wherever_it_comes_from(tmp_path: Path) -> None:
    file = write(tmp_path, "[sim]\nrate = 10\n")
    with pytest.raises(ConfigError, match=r"sim: .*system\.toml sets 'rate', .*known are"):
        load(Example, "sim", file, {})
    with pytest.raises(ConfigError, match="the environment sets 'rate'"):
        load(Example, "sim", environment={"AUTOCOMPLETE_SIM_RATE": "10"})
    with pytest.raises(ConfigError, match="the command line sets 'rate'"):
        load(Example, "sim", environment={}, flags={"rate": "10"})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("RATE_HZ", "fast"),
        ("RATE_HZ", "-1"),
        ("RATE_HZ", "nan"),
        ("RATE_HZ", "inf"),
        ("LOOPS", "1.5"),
        ("NOISY", "perhaps"),
        ("MODE", "medium"),
    ],
)
def test_a_bad_value_is_an_error_that_names_key_and_source(name: str, value: str) -> None:
    with pytest.raises(ConfigError, match=f"sim: the environment sets '{name.lower()}'"):
        load(Example, "sim", environment={f"AUTOCOMPLETE_SIM_{name}": value})


@pytest.mark.parametrize(("name", "allowed"), [("mode", "slow, fast"), ("noisy", "true, false")])
def test_what_can_be_counted_is_named_with_the_error(name: str, allowed: str) -> None:
    with pytest.raises(ConfigError, match=f"{name}.*; use {allowed}$"):
        load(Example, "sim", environment={}, flags={name: "maybe"})


@pytest.mark.parametrize("text", ["loops = 'many'", "rate_hz = 0", "mode = 'medium'", "least = 9"])
def test_an_error_names_its_field_once(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(Example, "sim", write(tmp_path, f"[sim]\n{text}\n"), {})
    assert str(caught.value).count(text.partition(" ")[0]) == 1


def test_what_is_right_only_together_may_be_set_together(tmp_path: Path) -> None:
    assert load(Example, "sim", environment={}, flags={"least": "7", "most": "9"}).least == 7
    file = write(tmp_path, "[sim]\nleast = 7\n")
    assert load(Example, "sim", file, {"AUTOCOMPLETE_SIM_MOST": "9"}).most == 9
    with pytest.raises(ConfigError, match=r"system\.toml sets 'least': must be below most"):
        load(Example, "sim", file, {"AUTOCOMPLETE_SIM_MOST": "6"})
    both = write(tmp_path, "[sim]\nleast = 7\nmost = 9\n")
    assert load(Example, "sim", both, {}, {"least": 2, "most": 4}).least == 2
    with pytest.raises(ConfigError, match="the command line sets 'rate_hz'"):
        load(Example, "sim", both, {}, {"rate_hz": -1.0})


def test_a_bad_value_is_blamed_on_its_source_though_a_better_one_wins(tmp_path: Path) -> None:
    file = write(tmp_path, "[sim]\nrate_hz = -1\n")
    with pytest.raises(ConfigError, match=r"system\.toml sets 'rate_hz'.*more than 0"):
        load(Example, "sim", file, {}, {"rate_hz": "5"})


@pytest.mark.parametrize("text", ["rate_hz = 10", "[simulator]\nx = 1", "[sim", "sim = 3"])
def test_a_file_that_is_no_table_a_service_is_an_error(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match=r"system\.toml"):
        load(Example, "sim", write(tmp_path, text), {})


def test_a_file_that_cannot_be_read_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        load(Example, "sim", tmp_path / "absent.toml", {})
    (tmp_path / "bin.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot be read"):
        load(Example, "sim", tmp_path / "bin.toml", {})
