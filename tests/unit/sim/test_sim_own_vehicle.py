"""A vehicle is one file, here the one of the docs: listed, flown, and known to the autopilot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest
from flights import fly
from msgspec import structs

import worlds
from common.frames import quaternion_of
from common.messages import Range, ResetRequest
from services.autopilot.config import Config as AutopilotConfig
from services.autopilot.core import Autopilot
from services.autopilot.plants import plant_of
from services.sim import plants
from services.sim.body import NO_LOADS, Sticks
from services.sim.build import ARDRONE
from services.sim.config import Config
from services.sim.core import Simulation
from services.sim.stage import Stage
from studies.lockstep import HandsOff, Lockstep

PAGE = Path(__file__).parents[3] / "docs" / "simulator.md"


@pytest.fixture
def heavy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    _, _, page = PAGE.read_text().partition("## A vehicle of your own")
    code, _, _ = page.partition("```python\n")[2].partition("```\n")
    (tmp_path / "heavy.py").write_text(code)
    monkeypatch.setattr(plants, "__path__", [*plants.__path__, str(tmp_path)])
    return "heavy"


def test_it_is_listed_and_flies_by_its_own_figures(heavy: str) -> None:
    assert heavy in plants.names()
    simulation = Simulation(Config(world="empty", plant=heavy, sensor_noise=0.0))
    assert simulation.state.position_m[2] == pytest.approx(0.15)
    fly(simulation, 2.0, action="takeoff")
    assert simulation.status().state == "flying"
    states, _ = fly(simulation, 4.0, Sticks(vx=0.5))
    speed = np.asarray([state.velocity_mps[0] for state in states])
    assert speed[-1] == pytest.approx(1.5, rel=0.02)
    assert np.interp(0.632 * speed[-1], speed, np.arange(len(speed)) / 200.0) == pytest.approx(
        1.0 / 1.5, rel=0.05
    )
    fly(simulation, 4.0, action="land")
    assert simulation.status().state == "landed"
    simulation.close()


def test_it_stands_beside_others_and_comes_by_a_reset(heavy: str) -> None:
    simulation = Simulation(Config(world="empty", vehicles=f"tum,{heavy}"))
    assert [actor.plant_name for actor in simulation.actors] == ["tum", heavy]
    assert simulation.reset(ResetRequest(plant=heavy, position=(3.0, 0.0, 0.0))).plant == heavy
    simulation.close()


def test_one_on_long_legs_takes_off_and_lands_and_does_not_measure_to_its_legs(
    heavy: str, tmp_path: Path
) -> None:
    code = (tmp_path / f"{heavy}.py").read_text()
    leg = 'Body("box", (0.1, 0.1, 0.3), (0.0, 0.0, -0.55), UPRIGHT, "metal")'
    (tmp_path / "tall.py").write_text(code.replace("hull=(RING,)", f"hull=(RING, {leg})"))
    simulation = Simulation(
        Config(world="empty", plant="tall", sensor_noise=0.0, command_noise=0.0, renderer="none")
    )
    assert simulation.state.position_m[2] == pytest.approx(0.7)
    fly(simulation, 0.1, action="takeoff")
    assert simulation.status().state == "taking_off"
    _, messages = fly(simulation, 2.0)
    assert simulation.status().state == "flying"
    height_m = simulation.state.position_m[2]
    assert height_m > 1.0
    assert [m.range for _, m in messages if isinstance(m, Range)][-1] == pytest.approx(
        height_m, abs=0.02
    )
    fly(simulation, 6.0, action="land")
    assert simulation.status().state == "landed"
    assert simulation.status().collisions == 0
    simulation.close()


@pytest.mark.parametrize(("tipped", "friction"), [(None, 0.1), (0.6, 0.6)])
def test_on_its_side_it_scrapes_as_it_does_upright_unless_it_says_otherwise(
    tipped: float | None, friction: float
) -> None:
    stage = Stage(worlds.load("empty"), 0.005)
    build = replace(ARDRONE, friction=0.1, friction_tipped=tipped)
    hull = stage.add(build)
    hull.place((0.0, 0.0, 1.0), 0.0)
    upright = hull.state()
    on_its_side = quaternion_of(1.5, 0.0, 0.0)
    for orientation, expected in ((upright.orientation, 0.1), (on_its_side, friction)):
        hull.restore(structs.replace(upright, orientation=orientation))
        hull.push(NO_LOADS, hull.state())
        assert pybullet.getDynamicsInfo(hull._body, -1, stage.client)[1] == expected
    stage.close()


def test_the_autopilot_holds_its_place_by_what_it_says_of_itself(heavy: str) -> None:
    simulation = Simulation(Config(world="empty", plant=heavy, sensor_noise=0.0))
    assert plant_of(simulation.status()) is not None
    lockstep = Lockstep(simulation, HandsOff(), autopilot=Autopilot(AutopilotConfig(), 0))
    lockstep.run(0.5)
    assert lockstep.decide("takeoff").ok
    lockstep.run(6.0)
    assert simulation.status().state == "flying"
    place = simulation.state.position_m
    lockstep.run(4.0)
    assert simulation.state.position_m == pytest.approx(place, abs=0.1)
    simulation.close()


def test_the_autopilot_leaves_a_rover_to_its_operator() -> None:
    simulation = Simulation(Config(world="empty", plant="rover"))
    autopilot = Autopilot(AutopilotConfig(), 0)
    lockstep = Lockstep(simulation, HandsOff(), autopilot=autopilot)
    lockstep.run(1.0)
    assert plant_of(simulation.status()) is None
    answer = lockstep.decide("takeoff")
    assert (answer.ok, answer.reason) == (False, "flying")
    answer = lockstep.decide("accept", 1)
    assert (answer.ok, answer.reason) == (False, "plant")
    assert lockstep.decide("emergency").ok
    lockstep.run(0.5)
    # It stands still, so it is parked at once, and let go by a take-off.
    assert simulation.status().state == "landed"
    assert lockstep.decide("takeoff").ok
    lockstep.run(0.2)
    assert simulation.status().state == "flying"
    assert autopilot.mode == "hover"
    simulation.close()
