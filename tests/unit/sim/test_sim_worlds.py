"""Worlds are read whole or refused with the file and the field."""

from pathlib import Path

import numpy as np
import pytest

import worlds


def test_every_world_that_is_shipped_loads() -> None:
    assert {"empty", "track"} <= set(worlds.names())
    for name in worlds.names():
        assert worlds.load(name).name == name


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
        (": : [", ""),
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


def test_an_unknown_world_is_refused_with_those_there_are() -> None:
    with pytest.raises(worlds.WorldError, match="track"):
        worlds.load("nowhere")
