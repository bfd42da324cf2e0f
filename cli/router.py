"""`autocomplete router`: an embedded Zenoh router."""

import argparse

import zenoh

from cli import options as opts
from common.run import stop_on_signals
from common.zenoh_bus import router_config


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--config", metavar="FILE", type=opts.existing_file, help="Zenoh's own configuration"
    )
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        default="tcp/[::]:7447",
        help="where to listen (tcp/[::]:7447); a file's own endpoints come first",
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    stop = stop_on_signals()
    with zenoh.open(router_config(options.listen, options.config)):
        stop.wait()
    return 0
