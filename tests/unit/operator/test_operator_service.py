"""The wiring, on the bus inside this process: a real pad adapter, a scripted autopilot."""

from collections.abc import Callable, Iterator

import pytest
from operator_pads import VirtualPads

from common import messages as m
from common.clock import SystemClock, sleep
from common.memory_bus import MemoryBus, MemoryNetwork
from common.node import Node
from services.operator import decisions
from services.operator.config import Config
from services.operator.service import wire

PS3 = "Sony PLAYSTATION(R)3 Controller"


class Chain:
    """The operator's node, an autopilot that is asked, and an ear for sticks."""

    def __init__(self, config: Config) -> None:
        network = MemoryNetwork()
        self.operator = Node(MemoryBus(network), "unit", "operator")
        self.others = Node(MemoryBus(network), "unit", "autopilot")
        self.sticks: list[m.Stick] = []
        self.requests: list[m.DecideRequest] = []
        self.others.on("stick", lambda stick, _: self.sticks.append(stick), depth=99)
        wire(self.operator, config)

    def answer(self, handler: Callable[[m.DecideRequest], m.DecideReply]) -> None:
        def decide(request: m.DecideRequest, _: int) -> m.DecideReply:
            self.requests.append(request)
            return handler(request)

        self.others.answer("autopilot/decide", decide)

    def spin(self, duration_s: float) -> None:
        clock = SystemClock()
        end_ns = clock.monotonic_ns() + round(duration_s * 1e9)
        while clock.monotonic_ns() < end_ns:
            self.operator.spin()
            self.others.spin()
            sleep(0.002)

    def close(self) -> None:
        self.operator.close()
        self.others.close()


@pytest.fixture
def chain() -> Iterator[Chain]:
    chain = Chain(Config(source="auto"))
    yield chain
    chain.close()


def granted(request: m.DecideRequest) -> m.DecideReply:
    return m.DecideReply(ok=True, reason=request.action, mode="engaged")


def test_a_pads_sticks_go_out_and_its_buttons_ask_once(chain: Chain) -> None:
    pads = VirtualPads()
    chain.answer(granted)
    instance = pads.plug(PS3)
    chain.spin(0.1)
    pads.move(instance, 1, -1.0)
    pads.press(instance, 5)
    pads.press(instance, 3)
    chain.spin(0.3)
    assert chain.sticks[-1].vx == 1.0
    assert chain.sticks[-1].buttons == ["square"]
    assert [request.action for request in chain.requests] == ["accept"]
    pads.press(instance, 5, down=False)
    chain.spin(0.05)
    pads.press(instance, 5)
    chain.spin(0.1)
    assert len(chain.requests) == 2
    assert chain.requests[0].nonce != chain.requests[1].nonce
    pads.unplug()
    chain.spin(0.1)
    assert chain.sticks[-1].vx == 0.0
    assert chain.sticks[-1].buttons is None


def test_a_lost_answer_is_asked_for_again_under_the_same_nonce(
    chain: Chain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(decisions, "TIMEOUT_S", 0.1)

    def slow(request: m.DecideRequest) -> m.DecideReply:
        if len(chain.requests) == 1:
            sleep(0.15)
        return granted(request)

    chain.answer(slow)
    asking = decisions.Decisions(chain.operator)
    asking.put("emergency")
    chain.spin(0.5)
    assert len(chain.requests) == 2
    assert chain.requests[0] == chain.requests[1]
    assert asking.take() == [decisions.Answer("emergency", True, "emergency")]


def test_an_autopilot_that_is_not_there_is_an_answer_too(
    chain: Chain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(decisions, "TIMEOUT_S", 0.05)
    asking = decisions.Decisions(chain.operator)
    asking.put("takeoff")
    chain.spin(0.2)
    assert [answer.ok for answer in asking.take()] == [False]
