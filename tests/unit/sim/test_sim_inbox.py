"""Commands wait in order; of too many the sticks go first, and an emergency never."""

from flights import command
from hypothesis import given
from hypothesis import strategies as st

from common.clock import ManualClock
from common.memory_bus import MemoryBus, MemoryNetwork
from common.messages import CommandAction, VehicleStatus, decode, encode
from common.node import Node
from common.topics import key_of
from services.sim.body import Sticks
from services.sim.config import Config
from services.sim.inbox import Inbox
from services.sim.service import wire

ACTIONS: tuple[CommandAction, ...] = ("fly", "takeoff", "land", "emergency")


@given(st.lists(st.sampled_from(ACTIONS), max_size=60), st.integers(1, 20))
def test_in_order_and_the_least_goes_first(actions: list[CommandAction], depth: int) -> None:
    inbox = Inbox(depth)
    for index, action in enumerate(actions):
        inbox.put(command(action=action), index)
    kept = [inbox.next().action for _ in range(len(inbox))]
    assert len(kept) == min(depth, len(actions))
    assert inbox.dropped == len(actions) - len(kept)
    for action in ("takeoff", "land", "emergency"):
        if kept.count(action) < actions.count(action):
            # Only where nothing of less worth was left.
            assert "fly" not in kept[:-1]
    assert kept.count("emergency") == min(depth, actions.count("emergency"))


def test_the_newest_sticks_are_obeyed_but_every_action() -> None:
    inbox = Inbox(64)
    for index, action in enumerate(("fly", "takeoff", "fly", "fly", "land", "fly")):
        inbox.put(command(Sticks(vx=index / 10), action), index)
    obeyed = [inbox.newest(since_ns=0) for _ in range(4)]
    assert [(each.action, each.vx) for each in obeyed if each] == [
        ("takeoff", 0.1),
        ("land", 0.4),
        ("fly", 0.5),
    ]
    assert obeyed[3] is None
    inbox.put(command(action="land"), 1)
    assert inbox.newest(since_ns=2) is None


def test_an_emergency_in_a_flood_of_sticks_is_obeyed() -> None:
    network, clock = MemoryNetwork(), ManualClock()
    node, ears = Node(MemoryBus(network), "unit", "sim", clock), MemoryBus(network)
    told: list[bytes] = []
    ears.subscribe(key_of("unit", "vehicle"), told.append)
    wire(node, Config(renderer="none", world="empty"))
    orders = ears.publication(key_of("unit", "command"), None, "")
    orders.put(encode(command(action="emergency")))
    for _ in range(200):
        orders.put(encode(command(Sticks(vx=1.0))))
    clock.advance(0.01)
    node.spin()
    clock.advance(0.01)
    node.spin()
    assert decode(told[-1], VehicleStatus).state == "emergency"
    node.close()
