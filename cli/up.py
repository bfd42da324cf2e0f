"""`autocomplete up`: all services on this machine, for a person at the console or a pad."""

import argparse
import sys

from rich.console import Console

from cli import launch
from cli import options as opts
from common.clock import sleep
from common.run import stop_on_signals
from common.topics import SERVICES


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--world", default="track", help="where to fly (track)")
    parser.add_argument(
        "--source", default="auto", help="auto, pad, keyboard or console: whose sticks fly (auto)"
    )
    parser.add_argument("--record", action="store_true", help="also record to an MCAP file")
    opts.add_local_system(parser)
    parser.epilog = "Then open http://localhost:8080, press 'take off', and fly."
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    stop = stop_on_signals()
    services = [name for name in SERVICES if name != "recorder" or options.record]
    settings = {
        "sim": {"world": options.world},
        "overlay": {"console_port": str(options.console_port)},
        "operator": {"source": options.source},
    }
    opts.require_free_console_port(options.console_port)
    try:
        with launch.running(services, settings, options.vehicle, options.config) as system:
            console = Console(stderr=True)
            console.print(f"console  http://localhost:{options.console_port}")
            console.print(f"router   {system.endpoint}")
            console.print(f"logs     {system.logs}")
            console.print("Ctrl-C stops everything.")
            while not stop.is_set():
                system.check()
                sleep(0.2)
    except launch.SystemFailedError as error:
        sys.stderr.write(f"autocomplete up: {error}\n")
        return 1
    return 0
