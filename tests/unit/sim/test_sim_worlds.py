"""Worlds are read whole or refused with the file and the field."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

import worlds
from common.messages import ResetRequest
from services.sim.build import ARDRONE
from services.sim.cameras import Shot, cameras_of
from services.sim.config import Config
from services.sim.core import STEP_S, ResetError, Simulation
from services.sim.renderer import GlRenderer, NoOpenGlError
from services.sim.service import check
from services.sim.stage import Stage


def test_every_world_that_is_shipped_loads() -> None:
    shipped = {"building", "empty", "field", "gazebo", "pole", "track"}
    assert set(worlds.names()) == shipped
    for name in worlds.names():
        assert worlds.load(name).name == name


@pytest.mark.parametrize("name", worlds.names())
def test_its_ideal_path_and_its_start_are_free(name: str) -> None:
    world = worlds.load(name)
    stage = Stage(world, STEP_S)
    hull = stage.add(ARDRONE)
    for x, y, z in [*world.ideal_path_m[::10], world.start_position_m]:
        hull.place((x, y, z), 0.0)
        assert not hull.overlaps(), (x, y, z)
    stage.close()


@pytest.mark.parametrize("name", worlds.names())
def test_what_stands_in_it_is_what_pybullet_has(name: str) -> None:
    world = worlds.load(name)
    stage = Stage(world, STEP_S)
    seen = {
        (b.shape, b.texture, *np.round(b.size_m + b.position_m, 4)) for b in stage.scene().bodies
    }
    meant = {(b.shape, b.texture, *np.round(b.size_m + b.position_m, 4)) for b in world.bodies}
    stage.close()
    assert seen == meant


def test_below_every_path_there_are_corners_in_all_parts_of_the_picture() -> None:
    try:
        renderer = GlRenderer()
    except NoOpenGlError as error:
        pytest.skip(f"no OpenGL here: {error}")
    down = cameras_of(Config())[1]
    for name in worlds.names():
        world = worlds.load(name)
        stage = Stage(world, STEP_S)
        renderer.load(stage.scene())
        stage.close()
        path = world.ideal_path_m if len(world.ideal_path_m) else np.asarray([(0.0, 0.0, 1.0)])
        for place in path[:: len(path) // 4 + 1]:
            shot = Shot("camera/down", 0, tuple(place.tolist()), (0.0, 0.0, 0.149, 0.989))
            grey = cv2.cvtColor(renderer.draw(down, shot), cv2.COLOR_BGR2GRAY)
            corners = cv2.goodFeaturesToTrack(grey, 200, 0.01, 8)
            assert len(corners) >= 60, (name, place)
            quarters = set(map(tuple, (corners[:, 0] // (160, 120)).astype(int)))
            assert len(quarters) == 4, (name, place)
    renderer.close()


def test_the_lap_around_the_gazebo_is_as_long_as_the_thesis_best() -> None:
    gazebo = worlds.load("gazebo")
    assert gazebo.closed
    assert sum(s.length_m for s in gazebo.segments) == pytest.approx(30.15, abs=0.02)


def test_a_helix_climbs_evenly_and_a_sine_keeps_to_its_axis() -> None:
    pole = worlds.load("pole")
    (helix,) = pole.segments
    assert helix.length_m == pytest.approx(math.hypot(3.0 * 6.0 * math.pi, 5.4))
    assert np.allclose(np.linalg.norm(pole.ideal_path_m[:, :2], axis=1), 3.0)
    assert np.allclose(np.diff(pole.ideal_path_m[:, 2], 2), 0.0, atol=1e-9)
    assert pole.ideal_path_m[-1, 2] == pytest.approx(6.4)
    field = worlds.load("field")
    x, y, _ = field.ideal_path_m.T
    assert np.allclose(y, 2.0 * np.sin(2.0 * math.pi * x / 8.0), atol=1e-9)
    assert x[-1] == pytest.approx(24.0, abs=1e-3)
    steps_m = np.linalg.norm(np.diff(field.ideal_path_m, axis=0), axis=1)
    assert steps_m.sum() == pytest.approx(field.segments[0].length_m, rel=1e-3)


def test_rows_and_rings_repeat_a_body(tmp_path: Path) -> None:
    file = tmp_path / "orchard.yaml"
    file.write_text(
        "description: trees\n"
        "bodies:\n"
        "  - {shape: box, size_m: [1, 1, 1], position_m: [1, 0, 2], texture: wood,"
        " rows: [{count: 3, step_m: [2, 0, 0]}, {count: 2, step_m: [0, 5, 0]}]}\n"
        "  - {shape: box, size_m: [1, 2, 1], position_m: [3, 1, 1], texture: wood,"
        " ring: {count: 4, centre_m: [1, 1]}}\n"
    )
    bodies = worlds.load(str(file)).bodies
    places = {tuple(np.round(b.position_m, 6)) for b in bodies[:6]}
    assert places == {(x, y, 2.0) for x in (1.0, 3.0, 5.0) for y in (0.0, 5.0)}
    ring = [b.position_m for b in bodies[6:]]
    assert np.allclose(ring, [(3, 1, 1), (1, 3, 1), (-1, 1, 1), (1, -1, 1)])
    # Each looks at the centre as the first does.
    assert bodies[7].orientation == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))


def test_a_file_of_ones_own_is_a_world_by_its_path(tmp_path: Path) -> None:
    file = tmp_path / "hall.yaml"
    file.write_text("description: mine\nstart: {position_m: [1, 2, 0]}\n")
    simulation = Simulation(Config(world=str(file)))
    assert simulation.status().world == str(file)
    assert simulation.state.position_m == pytest.approx((1.0, 2.0, 0.055))
    assert simulation.reset(ResetRequest(world="empty")).world == "empty"
    assert simulation.reset(ResetRequest(world=str(file))).world == str(file)
    # A file that was spoilt meanwhile is refused as any.
    simulation.reset(ResetRequest(world="empty"))
    file.write_text("description: mine\nground: snow\n")
    with pytest.raises(ResetError, match=r"hall\.yaml: .*snow.*; use asphalt") as caught:
        simulation.reset(ResetRequest(world=str(file)))
    assert caught.value.field == "world"
    assert simulation.status().world == "empty"
    other = tmp_path / "other.yaml"
    other.write_text("description: not named at the start\n")
    with pytest.raises(ResetError, match="track"):
        simulation.reset(ResetRequest(world=str(other)))
    with pytest.raises(ValueError, match="missing"):
        Config(world=str(tmp_path / "missing.yaml"))


def test_track_is_a_closed_oval_of_55_m_flown_counter_clockwise() -> None:
    track = worlds.load("track")
    steps_m = np.linalg.norm(np.diff(track.ideal_path_m, axis=0), axis=1)
    assert track.closed
    assert track.width_m == 3.0
    assert steps_m.sum() == pytest.approx(30.0 + 8.0 * np.pi, rel=1e-3)
    assert steps_m.max() <= worlds.PATH_STEP_M + 1e-9
    assert np.allclose(track.ideal_path_m[0], track.ideal_path_m[-1])
    assert np.all(track.ideal_path_m[:, 2] == 1.0)
    x, y = track.ideal_path_m[:, 0], track.ideal_path_m[:, 1]
    area_m2 = 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
    assert area_m2 == pytest.approx(15.0 * 8.0 + 16.0 * np.pi, rel=1e-3)
    assert sum(segment.length_m for segment in track.segments) == pytest.approx(55.13, abs=0.01)


def test_fences_leave_the_lane_free_and_stand_at_its_edges() -> None:
    track = worlds.load("track")
    fences = np.asarray([b.position_m for b in track.bodies if b.texture == "fence"])
    path = track.ideal_path_m[:, :2]
    gaps_m = np.linalg.norm(fences[:, None, :2] - path[None], axis=2).min(axis=1)
    assert len(fences) == 72
    assert np.all(np.abs(gaps_m - 1.5) < 0.06)


def test_sampling_follows_an_arc_of_either_hand(tmp_path: Path) -> None:
    file = tmp_path / "bend.yaml"
    file.write_text(
        "description: a bend\n"
        "ideal_path:\n"
        "  start_m: [1, 2, 3]\n"
        "  yaw_deg: 90\n"
        "  segments:\n"
        "    - {primitive: arc, radius_m: 2, sweep_deg: -90}\n"
        "    - {primitive: line, length_m: 4}\n"
    )
    path = worlds.load_file(file).ideal_path_m
    centre = np.asarray((3.0, 2.0))
    arc = path[path[:, 0] < 3.0]
    assert np.allclose(np.linalg.norm(arc[:, :2] - centre, axis=1), 2.0)
    assert np.allclose(path[-1], (7.0, 4.0, 3.0))


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("ground: grass", "description"),
        ("description: 3", "description"),
        ("description: a\nflavour: sweet", "flavour"),
        ("description: a\nground: snow", "ground"),
        ("description: a\nstart: {position_m: [0, 0]}", "position_m"),
        ("description: a\nstart: {position_m: [0, .nan, 0]}", "position_m"),
        ("description: a\nlane: {width_m: 3}", "lane"),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], segments: [{primitive: arc}]}",
            "radius_m",
        ),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], closed: true,"
            " segments: [{primitive: line, length_m: 1}]}",
            "closed",
        ),
        (
            "description: a\n"
            "bodies: [{shape: box, size_m: [1, 0, 1], position_m: [0, 0, 0], texture: crate}]",
            "size_m",
        ),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: sine, length_m: 5, amplitude_m: 1, wavelength_m: 4}]}",
            "length_m",
        ),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: line, length_m: 5, radius_m: 1}]}",
            "radius_m",
        ),
        (
            "description: a\n"
            "bodies: [{shape: sphere, size_m: [1, 1, 2], position_m: [0, 0, 0], texture: crate}]",
            "size_m",
        ),
        (": : [", "line 1, column"),
        ("description: a\nbodies: [1", "line 2, column"),
        ("description: a\nground: snow", "use asphalt, grass, concrete"),
        ("description: a\ngrond: grass", "`grond`; use description, ground, start"),
        (
            "description: a\n"
            "bodies: [{shape: box, size_m: [1, 1, 1], position_m: [0, 0, 0], texture: crate,"
            " ring: {count: 2, center_m: [0, 0]}}]",
            "`$.bodies[0].ring`; use count, centre_m",
        ),
        (
            "description: a\n"
            "bodies: [{shape: box, size_m: [1, 1, 1], position_m: [0, 0, 0], texture: crate,"
            " rows: [{count: 1000, step_m: [2, 0, 0]}, {count: 1000, step_m: [0, 2, 0]}]}]",
            "`bodies` are 1000000; 5000 at most",
        ),
        ("description: a\nstart: {yaw_deg: .nan}", "yaw_deg"),
        ("", "use description, ground, start"),
        ("description: a\nbodies: []\nground: grass\nbodies: []", "`bodies` is there twice"),
        ("description: a\nstart: {position_m: [0, 0, -1]}", "`$.start.position_m[2]`"),
        ("description: a\nstart: {position_m: [1001, 0, 0]}", "`$.start.position_m[0]`"),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: helix, radius_m: 2, sweep_deg: 360, climb_m: -3}]}",
            "`ideal_path` goes down to -2 m",
        ),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: arc, radius_m: 1000, sweep_deg: 3600}]}",
            "`ideal_path` is 62832 m long; 10000 m at most",
        ),
        (
            "description: a\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: sine, length_m: 1, amplitude_m: 9, wavelength_m: 1.0e-6}]}",
            "wavelength_m",
        ),
        (
            "description: a\nlane: {width_m: 4}\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: line, length_m: 9}, {primitive: arc, radius_m: 2, sweep_deg: 90}]}",
            "`lane.width_m` is 4, but a bend of the path has a radius of 2 m",
        ),
        (
            "description: a\nlane: {width_m: 4}\nideal_path: {start_m: [0, 0, 1], segments:"
            " [{primitive: sine, length_m: 12, amplitude_m: 2, wavelength_m: 6}]}",
            "`lane.width_m` is 4, but a bend of the path has a radius of 0.456 m",
        ),
    ],
)
def test_a_wrong_file_is_refused_with_its_name_and_the_field(
    tmp_path: Path, text: str, field: str
) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(text)
    with pytest.raises(worlds.WorldError) as caught:
        worlds.load_file(file)
    assert str(file) in str(caught.value)
    assert field in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_world_whose_start_is_taken_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "full.yaml"
    file.write_text(
        "description: a crate where it starts\n"
        "bodies: [{shape: box, size_m: [1, 1, 1], position_m: [0, 0, 0.2], texture: crate}]\n"
    )
    with pytest.raises(
        ResetError, match=r"full\.yaml: something stands.*; move that, or its `start`"
    ):
        Simulation(Config(world=str(file)))
    # No network is needed to say so.
    with pytest.raises(ValueError, match=r"^world: .*full\.yaml: something stands.*`start`"):
        check(Config(world=str(file)), "unit")
    # Who is told another place may go there.
    config = Config(world="empty")
    simulation = Simulation(config)
    simulation.worlds = lambda: ["empty", str(file)]
    with pytest.raises(ResetError, match="`start`"):
        simulation.reset(ResetRequest(world=str(file)))
    assert simulation.status().world == "empty"
    assert simulation.reset(ResetRequest(world=str(file), position=(3.0, 0.0, 0.0))).world == str(
        file
    )
    simulation.close()


def test_an_unknown_world_is_refused_with_those_there_are() -> None:
    with pytest.raises(worlds.WorldError, match="track"):
        worlds.load("nowhere")
