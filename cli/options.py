"""Options that several commands share."""

import argparse
import re
from pathlib import Path

from cli import launch
from common.topics import DEFAULT_VEHICLE, VEHICLE_PATTERN

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def vehicle(text: str) -> str:
    """A vehicle's name.

    Raises:
        argparse.ArgumentTypeError: if it is not one.
    """
    if not re.fullmatch(VEHICLE_PATTERN, text):
        raise argparse.ArgumentTypeError(f"{text!r}: use 1 to 32 of a-z 0-9 _ -")
    return text


def existing_file(text: str) -> Path:
    """The path of a file that is there.

    Raises:
        argparse.ArgumentTypeError: if it is not.
    """
    path = Path(text)
    if not path.is_file():
        raise argparse.ArgumentTypeError(f"{text}: no such file")
    return path


def add_network(parser: argparse.ArgumentParser) -> None:
    """Add --vehicle, --connect and --zenoh-config."""
    parser.add_argument(
        "--vehicle", type=vehicle, default=DEFAULT_VEHICLE, help="its name in every key (drone0)"
    )
    parser.add_argument(
        "--connect", metavar="ENDPOINT", default=DEFAULT_ENDPOINT, help=f"({DEFAULT_ENDPOINT})"
    )
    parser.add_argument(
        "--zenoh-config",
        metavar="FILE",
        type=existing_file,
        help="Zenoh's own configuration, for certificates and the like (JSON5)",
    )


def add_local_system(parser: argparse.ArgumentParser) -> None:
    """Add what commands that start a whole system share."""
    parser.add_argument(
        "--vehicle", type=vehicle, default=DEFAULT_VEHICLE, help="its name in every key (drone0)"
    )
    parser.add_argument(
        "--console-port", type=int, default=launch.CONSOLE_PORT, help="of the console's page (8080)"
    )
    parser.add_argument(
        "--config", metavar="FILE", type=existing_file, help="TOML with a table a service"
    )


def require_free_console_port(port: int) -> None:
    """See that the console can listen.

    Raises:
        ValueError: if somebody listens on `port` already.
    """
    if not launch.is_free(port):
        raise ValueError(f"--console-port: port {port} is taken; name another, for example 8090")
