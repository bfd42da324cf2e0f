"""Flying the simulator step by step."""

from collections.abc import Callable
from typing import Any

from common.messages import Command, CommandAction, Message, ResetRequest
from services.sim.body import BodyState, Sticks
from services.sim.config import Config
from services.sim.core import PHYSICS_HZ, Simulation

COMMAND_EVERY = PHYSICS_HZ // 50


def command(sticks: Sticks | None = None, action: CommandAction = "fly") -> Command:
    sticks = sticks or Sticks()
    return Command(
        stamp=0,
        seq=0,
        vx=sticks.vx,
        vy=sticks.vy,
        vz=sticks.vz,
        wz=sticks.wz,
        action=action,
        mode="manual",
    )


def hovering(world: str = "empty", height_m: float = 1.0, **settings: Any) -> Simulation:
    """A vehicle in the air without noise, unless the settings say otherwise."""
    config = Config(world=world, **{"command_noise": 0.0, "sensor_noise": 0.0, **settings})
    simulation = Simulation(config)
    simulation.reset(ResetRequest(position=(0.0, 0.0, height_m)))
    return simulation


def fly(
    simulation: Simulation,
    duration_s: float,
    sticks: Sticks | Callable[[float], Sticks] | None = None,
    action: CommandAction = "fly",
    silent: bool = False,
) -> tuple[list[BodyState], list[tuple[str, Message]]]:
    """The motion at each step and all messages, with commands at 50 Hz."""
    states, messages = [], []
    for count in range(round(duration_s * PHYSICS_HZ)):
        now = sticks(count / PHYSICS_HZ) if callable(sticks) else sticks
        due = not silent and count % COMMAND_EVERY == 0
        step = simulation.step(command(now, action) if due else None)
        states.append(simulation.state)
        messages += step.messages
    return states, messages
