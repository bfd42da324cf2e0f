"""A simulated person: skill and task, what he is doing, and how far he is. Pure."""

from dataclasses import dataclass
from enum import Enum

from common.messages import DecideAction


class Phase(Enum):
    """What he is doing."""

    WAITING = "waiting"
    TAKING_OFF = "taking off"
    CLIMBING = "climbing"
    SETTLING = "settling"
    STEERING = "steering"
    RELEASING = "letting go"
    ASKING = "accepting"
    WATCHING = "watching"
    STOPPING = "stopping"
    LANDING = "landing"
    DONE = "done"
    FAILED = "failed"


IN_THE_AIR = {
    Phase.CLIMBING,
    Phase.SETTLING,
    Phase.STEERING,
    Phase.RELEASING,
    Phase.ASKING,
    Phase.WATCHING,
    Phase.STOPPING,
}


@dataclass(frozen=True)
class Person:
    """His skill and his task.

    Attributes:
        speed_mps: what he likes to fly at.
        height_m: above the route's own height.
        laps: of the route; 0 for ever.
        accepts: whether he uses suggestions.
        reaction_s: from something to be seen to his first movement.
        tremor: of his hands, as a fraction of full stick.
        seed: of all his noise.
    """

    speed_mps: float = 0.85
    height_m: float = 0.0
    laps: int = 1
    accepts: bool = True
    reaction_s: float = 0.25
    tremor: float = 0.015
    seed: int = 1


@dataclass(frozen=True)
class Decision:
    """A button pressed."""

    action: DecideAction
    suggestion: int | None = None


@dataclass(frozen=True)
class Progress:
    """The mission so far."""

    phase: Phase = Phase.WAITING
    laps: int = 0
    suggestions: int = 0
    accepted: int = 0
    refused: int = 0
    takeovers: int = 0
    cancelled: int = 0
    distance_m: float = 0.0
    time_s: float = 0.0
    note: str = ""

    def __str__(self) -> str:
        """One line; it begins with `mission done` when there is nothing more to do."""
        names = {Phase.DONE: "mission done", Phase.FAILED: "mission failed"}
        begin = names.get(self.phase, f"mission {self.phase.value}")
        if self.note:
            begin += f" ({self.note})"
        return (
            f"{begin}: laps {self.laps} suggestions {self.suggestions} accepted {self.accepted}"
            f" takeovers {self.takeovers} cancelled {self.cancelled} refused {self.refused}"
            f" distance_m {self.distance_m:.1f} time_s {self.time_s:.1f}"
        )
