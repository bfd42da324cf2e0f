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
    opts.add_examples(
        parser,
        "autocomplete router",
        "autocomplete router --listen tcp/127.0.0.1:7448",
        "autocomplete router --config deploy/zenoh.json5",
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    stop = stop_on_signals()
    try:
        session = zenoh.open(router_config(options.listen, options.config))
    except zenoh.ZError as error:
        reason = str(error).split(" at /", 1)[0]
        raise OSError(
            f"cannot listen on {options.listen}: {reason}; name another with --listen"
        ) from None
    with session:
        stop.wait()
    return 0
