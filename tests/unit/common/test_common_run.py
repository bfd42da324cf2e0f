"""Running a service: what its exit code and its log say when things go wrong."""

import logging
import threading

import pytest

from common.memory_bus import MemoryBus, MemoryNetwork
from common.node import Node
from common.run import _serve


@pytest.mark.parametrize("fault", [ValueError, OSError, KeyError, ZeroDivisionError])
def test_a_fault_of_a_service_is_logged_and_exit_code_1(
    fault: type[Exception], caplog: pytest.LogCaptureFixture
) -> None:
    network = MemoryNetwork()
    node = Node(MemoryBus(network), "unit", "autopilot")

    def fail(_now_ns: int) -> None:
        raise fault("a bug")

    node.every(0.001, fail)
    with caplog.at_level(logging.ERROR):
        assert _serve(node, threading.Event()) == 1
    assert "autopilot failed" in caplog.text
    assert fault.__name__ in caplog.text


def test_a_service_that_is_told_to_stop_ends_with_0() -> None:
    stop = threading.Event()
    stop.set()
    assert _serve(Node(MemoryBus(MemoryNetwork()), "unit", "sim"), stop) == 0
