"""The cores in lock-step: the same flight every time, and what one says the others hear."""

import pytest

from common import messages as m
from services.autopilot.config import Config as AutopilotConfig
from services.autopilot.core import Autopilot
from services.localizer.config import Config as LocalizerConfig
from services.localizer.core import Localizer
from services.operator.person import Decision
from services.operator.sources import Deflection
from services.sim.config import Config as SimConfig
from services.sim.core import Simulation
from studies.darkroom import Darkroom
from studies.lockstep import HandsOff, Lockstep

CONFIG = SimConfig(world="empty", down_fps=30.0)


class TakesOff(HandsOff):
    """Presses one button, then flies to the left."""

    def __init__(self) -> None:
        self.pressed = False
        self.ok: bool | None = None

    def step(self, now_ns: int) -> tuple[Deflection, Decision | None]:
        if not self.pressed and now_ns > 300_000_000:
            self.pressed = True
            return Deflection(), Decision("takeoff")
        return Deflection(vy=0.5 if now_ns > 3_000_000_000 else 0.0), None

    def answered(self, action: m.DecideAction, ok: bool) -> None:
        self.ok = ok


def flight(seen: bool = False) -> tuple[Lockstep, list[m.Pose], list[m.Command]]:
    simulation = Simulation(CONFIG)
    step = Lockstep(
        simulation,
        TakesOff(),
        autopilot=Autopilot(AutopilotConfig(), 0),
        localizer=Localizer(LocalizerConfig()) if seen else None,
        darkroom=Darkroom(simulation, CONFIG) if seen else None,
    )
    poses: list[m.Pose] = []
    commands: list[m.Command] = []
    step.listen("pose", lambda pose, _: poses.append(pose))
    step.listen("command", lambda command, _: commands.append(command))
    return step, poses, commands


def test_a_button_and_sticks_reach_the_vehicle():
    step, poses, commands = flight()
    step.run(6.0)
    assert step.operator.ok
    assert {command.action for command in commands} >= {"takeoff", "fly"}
    assert 45 * 6 < len(commands) < 56 * 6
    assert len(poses) == 600
    assert {pose.source for pose in poses} == {"truth"}
    x, y, z = step.simulation.state.position_m
    assert y > 0.8
    assert z > 0.4
    assert abs(x) < 0.5


def test_the_same_seed_is_the_same_flight():
    ends = []
    for _ in range(2):
        step, _, commands = flight()
        step.run(4.0)
        ends.append((step.simulation.state, commands))
    assert ends[0] == ends[1]


def test_pictures_keep_the_localizer_on_the_vehicle():
    step, poses, _ = flight(seen=True)
    step.run(6.0)
    truth = step.simulation.state
    assert poses[-1].source != "truth"
    assert poses[-1].status == "ok"
    assert poses[-1].position == pytest.approx(truth.position_m, abs=0.1)


def test_waiting_ends_when_it_is_done_or_too_late():
    step, _, _ = flight()
    assert step.run_until(lambda: step.simulation.status().state == "flying", 5.0)
    assert 1.0 < step.now_ns / 1e9 < 3.0
    assert not step.run_until(lambda: False, 0.1)


def test_without_an_autopilot_the_sticks_fly_and_nobody_decides():
    step = Lockstep(Simulation(CONFIG), HandsOff())
    commands: list[m.Command] = []
    step.listen("command", lambda command, _: commands.append(command))
    step.run(0.2)
    assert len(commands) == 10
    with pytest.raises(ValueError, match="autopilot"):
        step.decide("takeoff")
