"""Runs one service as a process: configuration, log, bus, wiring, SIGTERM, exit code."""

import gc
import importlib
import logging
import os
import signal
import threading
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any

from common import config, log
from common.network import DEFAULT_ENDPOINT
from common.node import Node
from common.topics import DEFAULT_VEHICLE, key_of
from common.zenoh_bus import open_bus

ENDS_WITH_STDIN = "AUTOCOMPLETE_ENDS_WITH_STDIN"
"""Set for a process whose stdin is a pipe from the one that started it: it ends when that does."""

_logger = logging.getLogger(__name__)


def config_type_of(service: str) -> type[Any]:
    """The dataclass that configures a service: `Config` of its config module."""
    config_type: type[Any] = importlib.import_module(f"services.{service}.config").Config
    return config_type


def stop_on_signals() -> threading.Event:
    """An event that SIGTERM, SIGINT and SIGHUP set, and the end of a starter that asked for it."""
    stop = threading.Event()

    def request_stop(_signal: int, _frame: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGTERM, request_stop)
    signal.signal(signal.SIGINT, request_stop)
    # Under nohup a closed terminal is to be survived.
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, request_stop)
    if os.environ.get(ENDS_WITH_STDIN):
        threading.Thread(target=_await_end_of_stdin, args=(stop,), daemon=True).start()
    return stop


def _await_end_of_stdin(stop: threading.Event) -> None:
    # The kernel closes the pipe however the starter ends, by SIGKILL too. Not through sys.stdin:
    # its lock, held by a waiting thread, aborts the interpreter's own end.
    while os.read(0, 1024):
        pass
    stop.set()


def run_service(
    service: str,
    vehicle: str = DEFAULT_VEHICLE,
    endpoint: str = DEFAULT_ENDPOINT,
    config_file: Path | None = None,
    zenoh_config_file: Path | None = None,
    flags: Mapping[str, Any] | None = None,
) -> int:
    """Run a service until it is to stop; returns its exit code.

    Raises:
        ConfigError: if the configuration cannot be used.
        ValueError: if the vehicle's name or the endpoint cannot be used.
        OSError: if this machine lacks what the configuration asks for.
    """
    key_of(vehicle, service)  # refuses a name that no key can hold, before anything is opened
    settings = config.load(config_type_of(service), service, config_file, flags=flags)
    log.configure(service, vehicle)
    stop = stop_on_signals()
    wiring = importlib.import_module(f"services.{service}.service")
    node = None
    try:
        if hasattr(wiring, "check"):
            # What can be refused without a network does not wait for one.
            wiring.check(settings, vehicle)
        bus = open_bus(stop, endpoint, zenoh_config_file)
        if bus is None:
            return 0
        node = Node(bus, vehicle, service)
        wiring.wire(node, settings)
        # What is loaded by now stays: to search it for garbage stops the service for 20 ms or more.
        gc.collect()
        gc.freeze()
        _logger.info("%s is up", service)
        return _serve(node, stop)
    except config.ConfigError as error:
        # Well-formed, so it is no wrong usage: there is no such device, model or world here.
        raise OSError(str(error)) from None
    finally:
        if node is not None:
            node.close()


def _serve(node: Node, stop: threading.Event) -> int:
    try:
        node.run(stop)
    except Exception:
        # A fault of the service, whatever its type: it must not pass for one of the user's.
        _logger.exception("%s failed", node.service)
        return 1
    return 0
