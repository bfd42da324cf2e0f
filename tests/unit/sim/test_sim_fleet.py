"""Several vehicles share a world: each flies, senses and is reset for itself; they meet."""

import itertools
import math
import re
import threading
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from flights import command

import worlds
from cli.main import main
from common import log, run
from common.camera import Lens
from common.config import ConfigError, load
from common.messages import Command, Message, ResetRequest, encode
from services.sim import tiny
from services.sim.body import Sticks
from services.sim.cameras import Shot, cameras_of
from services.sim.config import Config
from services.sim.core import APART_M, PHYSICS_HZ, ResetError, Simulation
from services.sim.crew import crew_of, names_of
from services.sim.renderer import NoOpenGlError
from services.sim.stage import add_visible
from services.sim.studio import open_renderer
from worlds import Body

Messages = list[tuple[str, Message]]


def fly_all(
    simulation: Simulation, duration_s: float, *orders: Command | None
) -> tuple[list[Messages], list[list[Shot]]]:
    """Messages and shots of each vehicle, which hears its order 50 times a second."""
    said: list[Messages] = [[] for _ in simulation.actors]
    taken: list[list[Shot]] = [[] for _ in simulation.actors]
    for count in range(round(duration_s * PHYSICS_HZ)):
        due = list(orders) if count % 4 == 0 else [None] * len(orders)
        for index, step in enumerate(simulation.step_all(due)):
            said[index] += step.messages
            taken[index] += step.shots
    return said, taken


def raw(messages: Messages) -> list[tuple[str, bytes]]:
    return [(topic, encode(message)) for topic, message in messages]


@pytest.mark.parametrize("plant", ["tum", "ardrone"])
def test_others_do_not_change_the_first_ones_flight_by_a_bit(plant: str) -> None:
    heard = []
    for vehicles in ("1", f"{plant},rover,ardrone"):
        simulation = Simulation(
            Config(world="empty", plant=plant, vehicles=vehicles, seed=7, wind_mps=3.0)
        )
        others = [command(Sticks(vy=1.0), "takeoff")] * (len(simulation.actors) - 1)
        said, _ = fly_all(simulation, 1.0, command(Sticks(), "takeoff"), *others)
        more, _ = fly_all(simulation, 1.0, command(Sticks(vx=0.5)), *[None] * len(others))
        heard.append(raw(said[0] + more[0]))
        simulation.close()
    assert heard[0] == heard[1]


def test_each_has_noise_of_its_own_and_a_seed_is_the_same_flight_again() -> None:
    flights = []
    for _ in range(2):
        simulation = Simulation(Config(world="empty", vehicles="3", seed=2))
        flights.append([raw(said) for said in fly_all(simulation, 0.5, None, None, None)[0]])
        simulation.close()
    assert flights[0] == flights[1]
    imus = [[data for topic, data in said if topic == "imu"] for said in flights[0]]
    assert imus[0] != imus[1] != imus[2] != imus[0]


@pytest.mark.parametrize("name", worlds.names())
def test_they_start_apart_from_one_another_and_from_all_that_stands_there(name: str) -> None:
    simulation = Simulation(Config(world=name, vehicles="tum,ardrone,rover,tum,rover"))
    places = [actor.state.position_m for actor in simulation.actors]
    start = worlds.load(name)
    assert places[0][:2] == pytest.approx(start.start_position_m[:2])
    assert all(math.dist(a, b) > 0.9 * APART_M for a, b in itertools.combinations(places, 2))
    assert not any(actor.hull.overlaps() for actor in simulation.actors)
    fly_all(simulation, 0.5, *[None] * 5)
    assert [actor.status().collisions for actor in simulation.actors] == [0] * 5
    simulation.close()


def test_a_command_moves_only_whom_it_was_meant_for() -> None:
    simulation = Simulation(Config(world="empty", vehicles="3", command_noise=0.0))
    takeoff = command(action="takeoff")
    fly_all(simulation, 2.0, None, takeoff, None)
    fly_all(simulation, 1.0, None, command(Sticks(vx=1.0)), None)
    states = [actor.status().state for actor in simulation.actors]
    assert states == ["landed", "flying", "landed"]
    speeds = [actor.state.velocity_mps[0] for actor in simulation.actors]
    assert speeds == pytest.approx([0.0, 1.0, 0.0], abs=0.05)
    simulation.close()


@pytest.mark.parametrize("rammed", ["tum", "rover"])
def test_they_collide(rammed: str) -> None:
    simulation = Simulation(Config(world="empty", vehicles=f"tum,{rammed}", command_noise=0.0))
    height_m = 1.0 if rammed == "tum" else 0.15
    simulation.reset(ResetRequest(position=(-1.0, 0.0, max(height_m, 0.2))), 0)
    simulation.reset(ResetRequest(position=(0.5, 0.0, height_m)), 1)
    if rammed == "rover":
        fly_all(simulation, 0.1, command(action="takeoff"), None)
    ahead = command(Sticks(vx=1.0))
    before_m = simulation.actors[1].state.position_m[0]
    seen = []
    for _ in range(30):
        said, _ = fly_all(simulation, 0.1, ahead, command(Sticks()))
        seen += [message.collisions for topic, message in said[1] if topic == "vehicle"]  # type: ignore[attr-defined]
    assert all(actor.status().collisions >= 1 for actor in simulation.actors)
    assert max(seen) >= 1
    if rammed == "tum":
        assert simulation.actors[1].state.position_m[0] > before_m + 0.1
    simulation.close()


def test_a_reset_is_of_one_vehicle_and_another_world_of_all() -> None:
    simulation = Simulation(Config(world="empty", vehicles="tum,tum,rover"))
    fly_all(simulation, 1.0, *[command(Sticks(vx=0.5), "takeoff")] * 3)
    before = [actor.state for actor in simulation.actors]
    status = simulation.reset(ResetRequest(position=(5.0, 5.0, 1.0), seed=4), 1)
    assert (status.state, status.battery) == ("flying", 1.0)
    assert [simulation.actors[i].state for i in (0, 2)] == [before[0], before[2]]
    assert simulation.actors[1].state.position_m == pytest.approx((5.0, 5.0, 1.0))
    with pytest.raises(ResetError, match="free"):
        simulation.reset(ResetRequest(position=(5.1, 5.0, 1.0)), 2)
    assert simulation.actors[2].state == before[2]
    simulation.reset(ResetRequest(world="track"), 2)
    assert [actor.status().world for actor in simulation.actors] == ["track"] * 3
    assert [actor.status().state for actor in simulation.actors] == ["landed", "landed", "flying"]
    simulation.close()


def test_a_reset_makes_another_vehicle_of_one_or_changes_nothing() -> None:
    simulation = Simulation(Config(world="track", vehicles="2"))
    with pytest.raises(ResetError, match="free"):
        simulation.reset(ResetRequest(plant="rover", position=(4.5, 4.2, 0.5)), 1)
    fly_all(simulation, 0.2, None, None)
    assert simulation.actors[1].status().plant == "tum"
    status = simulation.reset(ResetRequest(plant="rover"), 1)
    assert (status.plant, status.state) == ("rover", "flying")
    fly_all(simulation, 1.0, None, command(Sticks(vx=1.0)))
    assert simulation.actors[1].state.velocity_mps[0] == pytest.approx(1.0, abs=0.02)
    assert simulation.actors[0].status().state == "landed"
    simulation.close()


def test_a_camera_sees_the_others_and_not_its_own_vehicle() -> None:
    simulation = Simulation(Config(world="empty", vehicles="tum,rover,ardrone"))
    _, taken = fly_all(simulation, 0.1, None, None, None)
    for index, shots in enumerate(taken):
        assert {shot.topic for shot in shots} == {"camera/front", "camera/down"}
        assert {shot.vehicle for shot in shots} == {index}
        others = [actor for actor in simulation.actors if actor.index != index]
        for figure, other in zip(shots[-1].others, others, strict=True):
            assert figure.look == other.plant.build.look
            assert math.dist(figure.position_m, other.state.position_m) < 1e-3
    simulation.close()


@pytest.mark.parametrize("choice", ["gl", "tiny"])
def test_another_vehicle_is_in_the_picture_where_it_is(choice: Literal["gl", "tiny"]) -> None:
    config = Config(world="empty", vehicles="tum,ardrone")
    simulation = Simulation(config)
    simulation.reset(ResetRequest(position=(0.0, 0.0, 2.0)), 0)
    simulation.reset(ResetRequest(position=(2.21, 0.5, 2.0)), 1)
    (shot,) = [s for s in fly_all(simulation, 0.034, None, None)[1][0] if s.topic == "camera/front"]
    try:
        renderer = open_renderer(choice)
    except NoOpenGlError:
        pytest.skip("no OpenGL here")
    renderer.load(simulation.scene())
    camera = cameras_of(config)[0]
    pictures = [
        renderer.draw(camera, each).astype(int).copy() for each in (shot, replace(shot, others=()))
    ]
    again = renderer.draw(camera, shot)
    assert np.abs(again - pictures[0]).max() == 0
    renderer.close()
    simulation.close()
    rows, columns = np.nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 8)
    # It is 2 m before the camera and 0.5 m to the left, half a metre wide.
    focal, _, cx, cy = camera.lens.intrinsics
    assert columns.mean() == pytest.approx(cx - focal * 0.25, abs=15.0)
    assert rows.mean() == pytest.approx(cy, abs=15.0)
    assert np.ptp(columns) == pytest.approx(focal * 0.26, rel=0.25)


def test_the_fallback_remakes_no_vehicle_for_the_next_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each would cost it 2 kB for ever."""
    made: list[Body] = []

    def make(body: Body, colour: tuple[float, ...], **on: int) -> int:
        made.append(body)
        return add_visible(body, colour, **on)

    monkeypatch.setattr(tiny, "add_visible", make)
    simulation = Simulation(Config(world="empty", vehicles="tum,rover,ardrone"))
    _, taken = fly_all(simulation, 0.1, None, None, None)
    renderer = tiny.TinyRenderer()
    renderer.load(simulation.scene())
    camera = replace(simulation.cameras()[1], lens=Lens.of_view(32, 24, 0.9))
    shots = [replace(each, topic=camera.topic) for shots in taken for each in shots]
    alone = renderer.draw(camera, replace(shots[0], others=()))
    for shot in shots:
        renderer.draw(camera, shot)
    looks = [each.plant.build.look for each in simulation.actors]
    assert len(made) == sum(map(len, looks))
    for shot in shots * 5:
        renderer.draw(camera, shot)
    assert len(made) == sum(map(len, looks))
    # Those who are not in a picture leave no trace in it.
    assert np.array_equal(renderer.draw(camera, replace(shots[0], others=())), alone)
    renderer.close()
    simulation.close()


@pytest.mark.parametrize(
    ("text", "first", "names", "plants"),
    [
        ("1", "drone0", ["drone0"], ["tum"]),
        ("3", "drone0", ["drone0", "drone1", "drone2"], ["tum"] * 3),
        ("3", "alpha", ["alpha", "alpha1", "alpha2"], ["tum"] * 3),
        ("tum,ardrone", "test41", ["test41", "test42"], ["tum", "ardrone"]),
        ("ardrone, mule=rover,tum", "a", ["a", "mule", "a2"], ["ardrone", "rover", "tum"]),
    ],
)
def test_names_count_on_from_the_first_unless_they_are_given(
    text: str, first: str, names: list[str], plants: list[str]
) -> None:
    crew = crew_of(text, "tum")
    assert list(names_of(crew, first)) == names
    assert [member.plant for member in crew] == plants


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0", "1 to 16 vehicles, not 0"),
        ("-1", "1 to 16 vehicles, not -1"),
        ("17", "1 to 16 vehicles, not 17"),
        ("", "plants are ardrone, rover, tum"),
        ("a,a", "'a' is no vehicle"),
        ("tum,,tum", "plants are ardrone, rover, tum"),
        ("tum=..", "NAME=PLANT"),
        ("x=nope", "plants are ardrone, rover, tum"),
        ("tum,Big Ben=tum", "'Big Ben' names no vehicle; use 1 to 32 of a-z 0-9 _ -"),
        ("tum,a=tum,a=rover", "two are named 'a'"),
        ("tum,drone0=tum", "two are named 'drone0'"),
        ("b=tum,rover", "--vehicle b"),
    ],
)
def test_wrong_vehicles_are_wrong_usage_in_one_line_that_says_what_is_allowed(
    text: str, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "stop_on_signals", threading.Event)
    monkeypatch.setattr(log, "configure", lambda *_: None)
    assert main(["run", "sim", "--vehicles", text]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(r"vehicles'?: ", line)
    assert said in line


def test_a_file_may_say_how_many_as_a_number(tmp_path: Path) -> None:
    file = tmp_path / "system.toml"
    for text, names in (("3", ["drone0", "drone1", "drone2"]), ("'tum,a=rover'", ["drone0", "a"])):
        file.write_text(f"[sim]\nvehicles = {text}\n")
        config = load(Config, "sim", file, {})
        assert list(names_of(crew_of(config.vehicles, config.plant), "drone0")) == names
    for text in ("0", "true", "2.5", "['tum', 'rover']"):
        file.write_text(f"[sim]\nvehicles = {text}\n")
        with pytest.raises(ConfigError, match=r"system\.toml sets 'vehicles'"):
            load(Config, "sim", file, {})
