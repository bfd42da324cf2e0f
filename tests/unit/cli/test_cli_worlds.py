"""`autocomplete worlds` lists the places to fly in, and draws them."""

import json
from pathlib import Path

import cv2
import pytest

import worlds
from cli.main import main


def test_it_lists_every_world(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["worlds", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["worlds"]}
    assert set(rows) == set(worlds.names())
    assert rows["gazebo"]["primitives"] == ["arc"]
    assert rows["gazebo"]["length_m"] == pytest.approx(30.16)
    assert main(["worlds"]) == 0
    assert "pavilion" in capsys.readouterr().out


def test_it_draws_a_plan_and_a_view_of_a_file_of_ones_own(tmp_path: Path) -> None:
    file = tmp_path / "hall.yaml"
    file.write_text(
        "description: a crate\n"
        "ideal_path: {start_m: [0, 0, 1], segments: [{primitive: line, length_m: 6}]}\n"
        "bodies: [{shape: box, size_m: [1, 1, 1], position_m: [3, 2, 0.5], texture: crate}]\n"
    )
    assert main(["worlds", str(file), "--draw", str(tmp_path)]) == 0
    picture = cv2.imread(str(tmp_path / "hall.jpg"))
    assert picture.shape == (400, 1120, 3)
    pink = (abs(picture.astype(int) - (255, 60, 230)).max(axis=2) < 60).sum(axis=0)
    # The path in both halves.
    assert pink[:560].sum() > 200
    assert pink[560:].sum() > 200


def test_an_unknown_world_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["worlds", "nowhere"]) == 2
    said = capsys.readouterr().err
    assert "nowhere" in said
    assert len(said.strip().splitlines()) == 1


def test_a_folder_that_cannot_be_made_is_one_line_that_names_the_flag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert main(["worlds", "empty", "--draw", str(tmp_path / "file")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"--draw: {tmp_path / 'file'}: File exists" in line
