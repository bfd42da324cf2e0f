"""`autocomplete router`: an embedded Zenoh router."""

import argparse
import json
import sys

import zenoh

from cli import options as opts
from common.network import ROUTER_PORT
from common.run import stop_on_signals
from common.zenoh_bus import router_config

POLL_S = 0.5
"""Python hears of a signal that another thread took only once the main one wakes."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--config", metavar="FILE", type=opts.existing_file, help="Zenoh's own configuration"
    )
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        type=opts.endpoint,
        default=f"tcp/[::]:{ROUTER_PORT}",
        help=f"where to listen (tcp/[::]:{ROUTER_PORT}); a file's own endpoints come first",
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
    config = router_config(options.listen, options.config)
    endpoints = json.loads(config.get_json("listen/endpoints"))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).split(" at /", 1)[0]
        listen, mend = f"the endpoints of {options.config}", "there"
        if endpoints == [options.listen]:
            listen, mend = options.listen, "with --listen"
        raise OSError(f"cannot listen on {listen}: {reason}; name another {mend}") from None
    with session:
        sys.stderr.write(f"router listens on {', '.join(endpoints)}; Ctrl-C stops it\n")
        while not stop.wait(POLL_S):
            pass
    return 0
