"""`autocomplete up`: all services on this machine, for a person at the console or a pad."""

import argparse
import contextlib
from typing import get_args

from rich.console import Console

import worlds
from cli import launch
from cli import options as opts
from cli.link import alive_services
from common.clock import sleep
from common.run import stop_on_signals
from common.zenoh_bus import open_bus
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
    opts.add_examples(
        parser,
        "autocomplete up                            # then open http://localhost:8080",
        "autocomplete up --world gazebo --record",
        "autocomplete up --source pad --config system.toml",
    )
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
        launch.say_where(system)
        bus = open_bus(stop, system.endpoint)
        if bus is None:
            return 0
        with contextlib.closing(bus):
            console = Console(stderr=True)
            with console.status("starting the services"):
                alive = alive_services(bus, system.vehicle)
                launch.wait_alive(system, alive, list(system.configs), stop)
        if not stop.is_set():
            page = f"open {system.console}, " if system.configs["overlay"].console_port else ""
            console.print(f"ready: {page}take off, and fly")
        while not stop.is_set():
            system.check()
            sleep(0.2)
    return 0
