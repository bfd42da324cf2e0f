"""Suggestions that a person who only holds the vehicle in its place would be bothered with."""

from collections.abc import Sequence
from dataclasses import dataclass

from common.clock import nanoseconds
from common.messages import NONE_LABEL, Stick
from services.classifier.config import Config
from services.classifier.core import Classifier
from services.classifier.model import Model
from training.dataset.primitive import Primitive

HOLD_S = 60.0


@dataclass(frozen=True)
class Bothered:
    """What came of it.

    Attributes:
        people: who held a place for `HOLD_S`.
        asked: intents.
        suggestions: those that are not `none`.
        bothered: people who got any.
    """

    people: int
    asked: int
    suggestions: int
    bothered: int


def bothered(model: Model, holds: Sequence[Primitive], period_s: float) -> Bothered:
    """Run each hold through the classifier's own core, asked every `period_s`."""
    asked, suggestions, people = 0, 0, 0
    period_ns = nanoseconds(period_s)
    for hold in holds:
        core = Classifier(Config(), model)
        due_ns, before = period_ns, suggestions
        for seq, (time_s, stick) in enumerate(
            zip(hold.times_s.tolist(), hold.sticks.tolist(), strict=True)
        ):
            now_ns = nanoseconds(time_s)
            while now_ns >= due_ns:
                asked += 1
                suggestions += core.intent(due_ns, due_ns).label != NONE_LABEL
                due_ns += period_ns
            core.on_stick(_stick(now_ns, seq, *stick), now_ns)
        people += suggestions > before
    return Bothered(len(holds), asked, suggestions, people)


def _stick(stamp: int, seq: int, vx: float, vy: float, vz: float, wz: float) -> Stick:
    return Stick(stamp=stamp, seq=seq, vx=vx, vy=vy, vz=vz, wz=wz)
