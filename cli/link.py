"""A command's link to a running system."""

import argparse
import contextlib
import threading
from collections.abc import Iterator

from common.bus import Bus
from common.topics import alive_key_of
from common.zenoh_bus import ZenohBus, open_bus

LINK_TIMEOUT_S = 3.0
"""A router on the other side of the world answers within this."""


def alive_services(bus: Bus, vehicle: str) -> set[str]:
    """The services of a vehicle that run, kept up to date by the bus."""
    alive: set[str] = set()

    def note(key: str, there: bool) -> None:
        service = key.rsplit("/", 1)[1]
        (alive.add if there else alive.discard)(service)

    bus.watch(alive_key_of(vehicle, "*"), note)
    return alive


@contextlib.contextmanager
def linked(options: argparse.Namespace, timeout_s: float = LINK_TIMEOUT_S) -> Iterator[ZenohBus]:
    """A bus to the router that the options name, closed on leaving.

    Raises:
        OSError: if there is no router within `timeout_s`.
    """
    give_up = threading.Event()
    timer = threading.Timer(timeout_s, give_up.set)
    timer.daemon = True
    timer.start()
    bus = open_bus(give_up, options.connect, options.zenoh_config)
    timer.cancel()
    if bus is None:
        raise OSError(
            f"no router at {options.connect}; start one with 'autocomplete router',"
            " or name another with --connect"
        )
    with contextlib.closing(bus):
        yield bus
