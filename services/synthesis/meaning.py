"""Which suggestion is on the screen, and whether the next one means the same.

A suggestion runs as long as the operator can still accept it. While it does, an intent that means
the same brings a newer path under the same id; one intent that says something else, without being
much surer, does not put it off the screen as long as the motion still fits it.
"""

import math
from dataclasses import dataclass

from common.clock import seconds
from common.messages import Intent
from common.topics import TOPICS
from services.synthesis.fitting import CONSISTENT_SIGMAS, inflation
from services.synthesis.primitives.shape import Shape

SURER = 0.5
"""An intent whose label is by this much more probable than the running primitive is believed."""
DIRECTIONS = ("heading", "phase", "climb")
"""Parameters that are the same after a whole turn."""


@dataclass(frozen=True)
class Running:
    """A suggestion that may be accepted.

    Attributes:
        id: its number.
        shape: what it means.
        arrival_ns: when the intent of its newest path arrived.
        doubted: the label of the last intent, if that said something else.
    """

    id: int
    shape: Shape
    arrival_ns: int
    doubted: str | None = None

    def lasts(self, now_ns: int) -> bool:
        """Whether it may still be accepted."""
        return seconds(now_ns - self.arrival_ns) <= TOPICS["suggestion"].max_age_s

    def outweighs(self, intent: Intent) -> bool:
        """Whether an intent that says something else is not yet to be believed."""
        mine = intent.probabilities.get(self.shape.name, 0.0)
        surer = intent.probabilities.get(intent.label, 0.0) - mine
        return self.doubted != intent.label and surer < SURER


def same(shape: Shape, other: Shape) -> bool:
    """Whether two shapes mean the same: one primitive, parameters equal within what is known.

    Parameters may differ by what a person would not call another path, and by what their standard
    errors leave open.
    """
    if shape.name != other.name:
        return False
    stds, other_stds = shape.stds, other.stds
    for name, tolerance in other.tolerances.items():
        difference = shape.params[name] - other.params[name]
        if name in DIRECTIONS:
            difference = math.remainder(difference, 2.0 * math.pi)
        spread = math.hypot(
            stds.get(name, 0.0) * inflation(shape), other_stds.get(name, 0.0) * inflation(other)
        )
        if abs(difference) > tolerance + CONSISTENT_SIGMAS * spread:
            return False
    return True
