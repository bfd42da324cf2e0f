"""Flown to its end, a path that was shortened before a wall does not touch it."""

import math

import numpy as np
import pytest

import worlds
from common.messages import Suggestion
from services.autopilot.config import Config as AutopilotConfig
from services.autopilot.core import Autopilot
from services.sim.config import Config as SimConfig
from services.sim.core import Simulation
from services.synthesis.config import Config
from services.synthesis.surroundings import Surroundings
from studies.lockstep import HandsOff, Lockstep


def towards_the_fence(here):
    """A line that crosses the track's fence, and the bend of a circle that does."""
    way = np.linspace(0.0, 12.0, 121)
    headings = {"line": np.full(121, math.radians(25.0)), "arc": way / 3.0}
    for heading in headings.values():
        steps = 0.1 * np.column_stack([np.cos(heading), np.sin(heading), np.zeros(121)])
        yield np.column_stack([here + np.cumsum(steps, axis=0) - steps[0], heading])


@pytest.mark.parametrize("shape", [0, 1], ids=["line", "arc"])
@pytest.mark.parametrize("shortened", [True, False], ids=["shortened", "whole"])
def test_a_shortened_path_ends_without_a_collision(shape, shortened):
    lockstep = Lockstep(
        Simulation(SimConfig(world="track", renderer="none")),
        HandsOff(),
        autopilot=Autopilot(AutopilotConfig(), 0),
    )
    lockstep.run(0.5)
    assert lockstep.decide("takeoff").ok
    lockstep.run(5.0)
    path = list(towards_the_fence(np.array(lockstep.simulation.state.position_m)))[shape]
    if shortened:
        surroundings = Surroundings(Config(), worlds.load("track").bodies)
        path = surroundings.keep(path, closed=False).path
        assert len(path) < 110
    lockstep.say(
        "suggestion",
        Suggestion(
            stamp=0,
            seq=0,
            id=1,
            primitive="line",
            params={},
            path=[tuple(map(float, point)) for point in path],
            closed=False,
            speed=0.8,
            fit_rms=0.0,
            confidence=1.0,
            heading_sector=0,
        ),
    )
    assert lockstep.decide("accept", 1).ok
    lockstep.run(18.0)
    collisions = lockstep.simulation.status().collisions
    if shortened:
        assert collisions == 0
        end = np.array(lockstep.simulation.state.position_m)
        assert np.linalg.norm(end - path[-1, :3]) < 0.5
    else:
        assert collisions > 0
