"""Runs one service as a process: configuration, log, bus, wiring, SIGTERM, exit code."""

import gc
import importlib
import logging
import signal
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any

from common import config, log
from common.node import Node
from common.topics import DEFAULT_VEHICLE, key_of
from common.zenoh_bus import DEFAULT_ENDPOINT, open_bus

_logger = logging.getLogger(__name__)


def config_type_of(service: str) -> type[Any]:
    """The dataclass that configures a service: `Config` of its config module."""
    module = importlib.import_module(f"services.{service}.config")
    return module.Config  # type: ignore[no-any-return]


def stop_on_signals() -> threading.Event:
    """An event that SIGTERM and SIGINT set."""
    stop = threading.Event()

    def request_stop(_signal: int, _frame: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGTERM, request_stop)
    signal.signal(signal.SIGINT, request_stop)
    return stop


def run_service(
    service: str,
    vehicle: str = DEFAULT_VEHICLE,
    endpoint: str = DEFAULT_ENDPOINT,
    config_file: Path | None = None,
    zenoh_config_file: Path | None = None,
    flags: Mapping[str, Any] | None = None,
) -> int:
    """Run a service until SIGTERM or SIGINT; returns its exit code.

    Raises:
        ConfigError: if the configuration cannot be used.
        ValueError: if the vehicle's name or the endpoint cannot be used.
    """
    key_of(vehicle, service)
    settings = config.load(config_type_of(service), service, config_file, flags=flags)
    log.configure(service, vehicle)
    stop = stop_on_signals()
    bus = open_bus(stop, endpoint, zenoh_config_file)
    if bus is None:
        return 0
    node = Node(bus, vehicle, service)
    try:
        importlib.import_module(f"services.{service}.service").wire(node, settings)
        # What is loaded by now stays: to search it for garbage stops the service for 20 ms or more.
        gc.collect()
        gc.freeze()
        _logger.info("%s is up", service)
        return _serve(node, stop)
    except config.ConfigError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    finally:
        node.close()


def _serve(node: Node, stop: threading.Event) -> int:
    try:
        node.run(stop)
    except Exception:
        # A fault of the service, whatever its type: it must not pass for one of the user's.
        _logger.exception("%s failed", node.service)
        return 1
    return 0
