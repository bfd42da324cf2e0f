"""A service's configuration: a frozen dataclass, set by file, environment, flags, in that order.

An unknown key is an error wherever it comes from. The file is TOML with a table a service, so that
one file can configure a whole system. The variable of field `camera_fps` of `sim` is
`AUTOCOMPLETE_SIM_CAMERA_FPS`, its flag `--camera-fps`.
"""

import dataclasses
import os
import tomllib
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from common.topics import SERVICES

ENV_PREFIX = "AUTOCOMPLETE_"

C = TypeVar("C")


class ConfigError(ValueError):
    """A configuration that cannot be used; the text says which key, where, and what is allowed."""


def _table_of(path: Path, service: str) -> dict[str, Any]:
    try:
        document = tomllib.loads(path.read_text())
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    for key, value in document.items():
        if key not in SERVICES or not isinstance(value, dict):
            raise ConfigError(f"{path}: {key!r} is no table of a service ({', '.join(SERVICES)})")
    table: dict[str, Any] = document.get(service, {})
    return table


def _variables_of(environment: Mapping[str, str], service: str) -> dict[str, str]:
    prefix = f"{ENV_PREFIX}{service.upper()}_"
    return {
        name.removeprefix(prefix).lower(): value
        for name, value in environment.items()
        if name.startswith(prefix)
    }


def _fault_of(config_type: type, key: str, values: Mapping[str, Any]) -> str:
    """What is wrong with a value among others, without its name; empty if nothing is."""
    try:
        checked: Any = msgspec.convert(values, config_type, strict=False)
        if isinstance(number := getattr(checked, key), float) and not isfinite(number):
            raise ValueError(f"{number} is no number to work with")
    except (msgspec.ValidationError, ValueError) as error:
        text = str(error).removesuffix(f" - at `$.{key}`")
        for prefix in (f"{key}: ", f"{key} "):
            text = text.removeprefix(prefix)
        choices = choices_of(config_type, key)
        return f"{text}; use {', '.join(choices)}" if choices else text
    return ""


def _is_right_beside(config_type: type, key: str, value: object, others: Mapping[str, Any]) -> bool:
    """Whether a value is right beside those of others that are right alone."""
    right = {k: v for k, v in others.items() if not _fault_of(config_type, k, {k: v})}
    return not _fault_of(config_type, key, {**right, key: value})


def choices_of(config_type: type, key: str) -> tuple[str, ...]:
    """All that a field takes, if that can be counted; else nothing."""
    kind = get_type_hints(config_type).get(key)
    if kind is bool:
        return ("true", "false")
    return tuple(map(str, get_args(kind))) if get_origin(kind) is Literal else ()


def load(
    config_type: type[C],
    service: str,
    file: Path | None = None,
    environment: Mapping[str, str] | None = None,
    flags: Mapping[str, Any] | None = None,
) -> C:
    """The configuration of a service.

    Args:
        config_type: a frozen dataclass whose fields all have defaults.
        service: the service's name.
        file: a TOML file with a table for the service, or None.
        environment: the process' variables (default: `os.environ`).
        flags: values from the command line, by field; None means not given.

    Raises:
        ConfigError: on an unknown key or a value that does not fit.
    """
    sources: list[tuple[str, Mapping[str, Any]]] = []
    if file is not None:
        sources.append((str(file), _table_of(file, service)))
    sources.append(
        (
            "the environment",
            _variables_of(os.environ if environment is None else environment, service),
        )
    )
    sources.append(("the command line", {k: v for k, v in (flags or {}).items() if v is not None}))

    known = {field.name for field in dataclasses.fields(config_type)}  # type: ignore[arg-type]
    for origin, given in sources:
        for key in given:
            if key not in known:
                raise ConfigError(
                    f"{service}: {origin} sets {key!r}, which is unknown;"
                    f" known are {', '.join(sorted(known))}"
                )
    values = {key: value for _, given in sources for key, value in given.items()}
    for origin, given in sources:
        for key, value in given.items():
            # Checked one by one, so that an error can say where the value came from; some are
            # right only beside another one, as the ends of a range: of its source or of all.
            fault = _fault_of(config_type, key, {key: value})
            if fault and not any(
                _is_right_beside(config_type, key, value, others) for others in (given, values)
            ):
                raise ConfigError(f"{service}: {origin} sets {key!r}: {fault}")
    try:
        return msgspec.convert(values, config_type, strict=False)
    except (msgspec.ValidationError, ValueError) as error:
        raise ConfigError(f"{service}: {error}") from None
