"""Paths flown in the simulator's own plants and wind, by the autopilot and by its rivals."""

import numpy as np
import pytest

from services.autopilot.follower import Follower
from studies.baselines.goto import COMMANDS, GotoQueue, hurried
from studies.baselines.predictive import PredictiveFollower
from studies.tracking import HOVER, PATHS, Case, arc, fly, line


@pytest.mark.parametrize("plant", ["tum", "ardrone"])
@pytest.mark.parametrize("primitive", ["line", "arc"])
def test_in_3_mps_of_wind_the_autopilot_keeps_to_the_path(plant, primitive):
    flight = fly(Case(primitive, plant, wind_mps=3.0, seed=1))
    assert flight.is_complete
    assert flight.rmse_m < 0.05
    assert flight.speed_mps > 0.3


@pytest.mark.parametrize("follow", [PredictiveFollower, GotoQueue, hurried])
def test_rivals_fly_a_line_in_calm_air(follow):
    flight = fly(Case("line", "ardrone", seed=2), follow)
    assert flight.is_complete
    assert flight.rmse_m < 0.1


def test_a_case_is_the_same_flight_every_time():
    one, other = (fly(Case("sine", wind_mps=3.0, gusts=True, seed=3), Follower) for _ in range(2))
    assert np.array_equal(one.flown_m, other.flown_m)


def test_a_path_that_cannot_be_accepted_is_an_error(monkeypatch):
    monkeypatch.setitem(PATHS, "line", (lambda: line(400.0), False, 1.0))
    with pytest.raises(RuntimeError, match="geofence"):
        fly(Case("line"))


def test_the_ideal_paths_are_what_they_are_called():
    circle = np.array(arc())[:, :2] - (0.0, 2.0)
    assert np.hypot(*circle.T) == pytest.approx(2.0)
    helix = np.array(arc(turns=2.0, pitch_m=0.6))
    assert helix[-1, 2] == pytest.approx(1.2, abs=0.02)
    assert helix[-1, 3] == pytest.approx(4.0 * np.pi, abs=0.1)
    assert COMMANDS == 64


def test_a_hover_keeps_its_place_in_wind():
    flight = fly(Case(HOVER, "ardrone", wind_mps=3.0, seed=1))
    assert flight.is_complete
    assert flight.path_m.shape == (1, 3)
    assert flight.rmse_m < 0.05
