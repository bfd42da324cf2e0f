"""One whole mission, headless: every service a process, flown by the scripted operator."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from cli.launch import free_port

FIGURES = {
    "laps",
    "distance_m",
    "time_s",
    "suggestions",
    "accepted",
    "takeovers",
    "collisions",
    "hausdorff_m",
    "front_fps",
    "real_time_factor",
}


@pytest.mark.timeout(200)
def test_one_lap_is_flown_with_accepted_suggestions_and_no_collision() -> None:
    command = [str(Path(sys.executable).with_name("autocomplete")), "demo", "--once", "--json"]
    run = subprocess.run(
        [*command, "--vehicle", "mission", "--console-port", str(free_port())],
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    figures = json.loads(run.stdout.splitlines()[-1])
    assert set(figures) == FIGURES
    assert figures["laps"] >= 1
    assert figures["accepted"] >= 3
    assert figures["takeovers"] >= 1
    assert figures["collisions"] == 0
    # The lane is 3 m wide: half of it, less half a drone, is as far as one may stray.
    assert figures["hausdorff_m"] < 1.5
    assert 50.0 < figures["distance_m"] < 75.0
