"""The console's server where it cannot be one."""

import socket
from collections.abc import Iterator

import pytest

from common.clock import ManualClock
from services.overlay.console import Console
from services.overlay.lease import PadLease


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield other.getsockname()[1]


def console(host: str, port: int) -> Console:
    return Console(host, port, lambda _: None, lambda _: None, PadLease(), ManualClock())  # type: ignore[arg-type, return-value]


@pytest.mark.parametrize("host", ["..", "a" * 64 + ".example"])
def test_a_host_that_is_no_name_is_told(host: str) -> None:
    with pytest.raises(OSError, match="is no host"):
        console(host, 0).start()


def test_a_port_that_is_taken_is_told(taken_port: int) -> None:
    with pytest.raises(OSError, match="in use"):
        console("127.0.0.1", taken_port).start()


def test_one_that_could_not_start_can_be_closed(taken_port: int) -> None:
    server = console("127.0.0.1", taken_port)
    with pytest.raises(OSError, match="in use"):
        server.start()
    server.close()
    server.close()
