"""In lock-step physics waits for commands, and a seed is a flight to the bit, pictures included."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from flights import command

from common.clock import ManualClock
from common.memory_bus import MemoryBus, MemoryNetwork
from common.messages import Command, Image, Pose, ResetRequest, VehicleStatus, decode, encode
from common.node import Node
from common.topics import key_of
from services.sim.body import Sticks
from services.sim.config import Config
from services.sim.service import wire
from services.sim.stage import Scene
from services.sim.studio import Studio

TOPICS = ("imu", "truth", "altimeter", "camera/front", "camera/down")


@contextmanager
def stage(config: Config) -> Iterator[tuple[Node, ManualClock, dict[str, list[bytes]]]]:
    """The simulator, its clock, and what it has sent."""
    network, clock = MemoryNetwork(), ManualClock()
    node = Node(MemoryBus(network), "unit", "sim", clock)
    ears = MemoryBus(network)
    heard: dict[str, list[bytes]] = {topic: [] for topic in TOPICS}
    for topic, payloads in heard.items():
        ears.subscribe(key_of("unit", topic), payloads.append)
    wire(node, config)
    try:
        yield node, clock, heard
    finally:
        node.close()


def orders_to(node: Node, vehicle: str) -> Callable[[Command], None]:
    """What brings a vehicle its commands."""
    publication = MemoryBus(node.bus._network).publication(key_of(vehicle, "command"), None, "")
    return lambda order: publication.put(encode(order))


def said_by(node: Node, vehicle: str, topic: str) -> list[bytes]:
    """What a vehicle says from now on."""
    said: list[bytes] = []
    MemoryBus(node.bus._network).subscribe(key_of(vehicle, topic), said.append)
    return said


def reset(node: Node, request: ResetRequest) -> VehicleStatus:
    handler = next(each.handler for each in node._servers if each.query.name == "sim/reset")
    return handler(request, 0)


def flown(seed: int, renderer: str, duration_s: float) -> dict[str, list[bytes]]:
    config = Config(seed=seed, clock="lockstep", renderer=renderer)
    with stage(config) as (node, _, heard):
        order = orders_to(node, "unit")
        for count in range(round(duration_s * 50)):
            action = "takeoff" if count < 5 else "fly"
            order(command(Sticks(vx=0.3, wz=0.1), action))
            node.spin()
        return heard


def test_physics_waits_for_commands_however_long_that_takes() -> None:
    with stage(Config(clock="lockstep", renderer="none")) as (node, clock, heard):
        for _ in range(100):
            clock.advance(0.1)
            node.spin()
        assert heard["truth"] == []
    assert len(flown(1, "none", 0.5)["truth"]) == 50


def test_a_seed_is_a_flight_to_the_bit() -> None:
    assert flown(5, "none", 3.0) == flown(5, "none", 3.0)
    assert flown(5, "none", 1.0)["imu"] != flown(6, "none", 1.0)["imu"]


def test_no_picture_is_dropped() -> None:
    first, second = (flown(5, "auto", 0.2) for _ in range(2))
    assert first == second
    assert (len(first["camera/front"]), len(first["camera/down"])) == (6, 12)


def test_a_reset_is_granted_while_it_waits() -> None:
    with stage(Config(clock="lockstep", renderer="none")) as (node, _, heard):
        request = ResetRequest(world="empty", position=(1.0, 2.0, 3.0))
        assert reset(node, request).world == "empty"
        assert heard["truth"] == []


def test_only_another_world_is_another_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes: list[Scene] = []
    monkeypatch.setattr(Studio, "load", lambda _studio, scene: scenes.append(scene))
    with stage(Config(clock="lockstep")) as (node, _, _):
        reset(node, ResetRequest(position=(1.0, 0.0, 1.0), seed=2, plant="rover"))
        reset(node, ResetRequest(world="track"))
        assert len(scenes) == 1
        reset(node, ResetRequest(world="empty"))
        assert [len(scene.bodies) > 0 for scene in scenes] == [True, False]


def test_pictures_noise_is_that_of_the_seed_which_a_reset_gives() -> None:
    config = Config(clock="lockstep", picture_noise=1.0, seed=4, wind_mps=3.0, exposure_s=0.01)
    with stage(config) as (node, _, heard):
        order = orders_to(node, "unit")

        def pictures(commands: int) -> list[bytes]:
            for topic in ("camera/front", "camera/down"):
                heard[topic].clear()
            for _ in range(commands):
                order(command(Sticks(vx=0.3)))
                node.spin()
            return [
                decode(payload, Image).data
                for topic in ("camera/front", "camera/down")
                for payload in heard[topic]
            ]

        flights = []
        for seed, commands in ((9, 7), (9, 5), (8, 5)):
            # Flown for another while before, its pictures are those of its seed all the same.
            reset(node, ResetRequest(position=(0.0, 0.0, 1.0), seed=seed))
            flights.append(pictures(commands))
        first, again, other = flights
        assert len(first) > len(again) == len(other) == 9
        reset(node, ResetRequest(position=(0.0, 0.0, 1.0), seed=9))
        assert pictures(7) == first
        assert not set(first) & set(other)


def test_no_action_is_lost_while_another_vehicle_is_silent() -> None:
    config = Config(clock="lockstep", renderer="none", vehicles="tum,second=tum", world="empty")
    with stage(config) as (node, clock, heard):
        told = said_by(node, "unit", "vehicle")
        first, second = orders_to(node, "unit"), orders_to(node, "second")
        for action in ["takeoff"] * 2 + ["fly"] * 98:
            first(command(action=action))
            node.spin()
            clock.advance(0.02)
        assert heard["truth"] == []
        for _ in range(100):
            second(command())
        # However long they wait: simulated time has not gone on meanwhile.
        clock.advance(10.0)
        node.spin()
        states = [decode(payload, VehicleStatus).state for payload in told]
        assert len(heard["truth"]) == 200
        assert "taking_off" in states
        assert states[-1] == "flying"


def test_with_several_vehicles_physics_waits_for_the_command_of_each() -> None:
    config = Config(clock="lockstep", renderer="none", vehicles="tum,mule=rover", world="empty")
    with stage(config) as (node, _, heard):
        mule = said_by(node, "mule", "truth")
        first, second = orders_to(node, "unit"), orders_to(node, "mule")
        for _ in range(5):
            first(command())
            node.spin()
        assert heard["truth"] == mule == []
        for _ in range(2):
            second(command(Sticks(vx=1.0)))
            node.spin()
        # Each pair of commands is that of 20 ms.
        assert (len(heard["truth"]), len(mule)) == (4, 4)
        for _ in range(10):
            second(command(Sticks(vx=1.0)))
        node.spin()
        assert (len(heard["truth"]), len(mule)) == (10, 10)
        assert decode(mule[-1], Pose).velocity[0] > 0.1
        assert abs(decode(heard["truth"][-1], Pose).velocity[0]) < 1e-3
