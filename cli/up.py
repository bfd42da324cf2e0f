"""`autocomplete up`: all services on this machine, for a person at the console or a pad."""

import argparse
from typing import get_args

from rich.console import Console

import worlds
from cli import launch
from cli import options as opts
from common.clock import sleep
from common.run import stop_on_signals
from services.operator.config import Source


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--world",
        metavar="WORLD",
        type=_world,
        help=f"where to fly: {', '.join(worlds.names())}, or a YAML file of your own (track)",
    )
    parser.add_argument(
        "--source",
        metavar="SOURCE",
        choices=get_args(Source),
        help=f"whose sticks fly: {', '.join(get_args(Source))} (auto)",
    )
    opts.add_local_system(parser)
    parser.epilog = "Then open http://localhost:8080, press 'take off', and fly."
    parser.set_defaults(action=_run)


def _world(text: str) -> str:
    try:
        return worlds.load(text).name
    except worlds.WorldError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _run(options: argparse.Namespace) -> int:
    stop = stop_on_signals()
    settings = {
        "sim": {"world": options.world},
        "operator": {"source": options.source, "world": options.world},
    }
    with launch.running_as_asked(options, settings) as system:
        console = Console(stderr=True)
        console.print(f"console  {system.console}")
        console.print(f"router   {system.endpoint}")
        console.print(f"logs     {system.logs}")
        console.print("Ctrl-C stops everything.")
        while not stop.is_set():
            system.check()
            sleep(0.2)
    return 0
