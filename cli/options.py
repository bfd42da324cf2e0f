"""Options that several commands share."""

import argparse
import math
import os
import re
from pathlib import Path

from common.network import DEFAULT_ENDPOINT, ENDPOINT_PATTERN
from common.topics import DEFAULT_VEHICLE, VEHICLE_PATTERN


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


def folder(text: str) -> Path:
    """The path of a folder, there or to be made.

    Raises:
        argparse.ArgumentTypeError: if something else is there.
    """
    path = Path(text)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no folder; name another one")
    return path


def positive(text: str) -> int:
    """A count of 1 or more.

    Raises:
        argparse.ArgumentTypeError: if it is not.
    """
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: use a whole number from 1")
    return int(text)


def port(text: str) -> int:
    """A TCP port.

    Raises:
        argparse.ArgumentTypeError: if it is not one.
    """
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: use a port, 1 to 65535")
    return int(text)


def seed(text: str) -> int:
    """What noise is drawn from.

    Raises:
        argparse.ArgumentTypeError: if it is not a whole number from 0.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: use a whole number from 0")
    return int(text)


def endpoint(text: str) -> str:
    """An endpoint of Zenoh.

    Raises:
        argparse.ArgumentTypeError: if it is not one.
    """
    if not ENDPOINT_PATTERN.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no endpoint; write for example {DEFAULT_ENDPOINT}"
        )
    return text


def duration(text: str) -> float:
    """A time in s, more than none.

    Raises:
        argparse.ArgumentTypeError: if it is not.
    """
    try:
        duration_s = float(text)
    except ValueError:
        duration_s = math.nan
    if not 0.0 < duration_s < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r}: use seconds, more than 0")
    return duration_s


def add_examples(parser: argparse.ArgumentParser, *commands: str) -> None:
    """End a command's help with commands that work."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "\n  ".join(["examples:", *commands])


def add_network(parser: argparse.ArgumentParser) -> None:
    """Add --vehicle, --connect and --zenoh-config; the environment gives the first two."""
    parser.add_argument(
        "--vehicle",
        type=vehicle,
        default=os.environ.get("AUTOCOMPLETE_VEHICLE") or DEFAULT_VEHICLE,
        help=f"its name in every key ($AUTOCOMPLETE_VEHICLE or {DEFAULT_VEHICLE})",
    )
    parser.add_argument(
        "--connect",
        metavar="ENDPOINT",
        type=endpoint,
        default=os.environ.get("AUTOCOMPLETE_CONNECT") or DEFAULT_ENDPOINT,
        help=f"the router's endpoint ($AUTOCOMPLETE_CONNECT or {DEFAULT_ENDPOINT})",
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
        "--console-port", metavar="PORT", type=port, help="of the console's page (8080)"
    )
    parser.add_argument("--record", action="store_true", help="also record to an MCAP file")
    parser.add_argument(
        "--config", metavar="FILE", type=existing_file, help="TOML with a table a service"
    )
