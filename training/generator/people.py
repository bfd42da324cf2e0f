"""People: what distinguishes one pair of hands from another, and how habits are drawn.

Each habit has its unit, the range of ordinary people, and where the range is from: a figure of the
literature (named), the thesis, or chosen. docs/people.md is the table to read.
"""

from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SECONDARY_SHARE = 0.13
"""How likely it is that a person has a trait which is not that of the family (chosen)."""


def _habit(unit: str, low: float, high: float, source: str) -> dict[str, Any]:
    return {"unit": unit, "range": (low, high), "source": source}


@dataclass(frozen=True)
class People:
    """n people; each habit (n,)."""

    reaction_s: Array = field(
        metadata=_habit("s", 0.15, 0.32, "delays 0.05 to 0.6 s, arXiv 1808.05002")
    )
    """From what is seen to the first movement that answers it."""
    lag_s: Array = field(metadata=_habit("s", 0.03, 0.1, "order of McRuer's 0.1 s, recalled"))
    """Of arm and thumb: time constant of each of two first-order lags."""
    tremor: Array = field(metadata=_habit("full stick", 0.003, 0.02, "chosen"))
    """Standard deviation of the tremor of a thumb that pushes."""
    tremor_hz: Array = field(metadata=_habit("Hz", 8.0, 12.0, "Novak & Newell 2017"))
    """Its frequency."""
    signal_noise: Array = field(
        metadata=_habit("share", 0.03, 0.12, "error grows with force, Sutton 1967")
    )
    """Noise of a push as a share of the push."""
    wander_rad: Array = field(metadata=_habit("rad", 0.02, 0.12, "chosen"))
    """Slow wander of the direction of a push or of an aim."""
    bend_rad: Array = field(metadata=_habit("rad", 0.03, 0.2, "chosen"))
    """A shape done badly: how far it bends as a whole (standard deviation)."""
    uneven: Array = field(metadata=_habit("share", 0.1, 0.5, "chosen"))
    """A shape done badly: an arc that tightens or opens, a swing that grows or fades."""
    warp: Array = field(metadata=_habit("share", 0.05, 0.3, "chosen"))
    """Uneven pace."""
    imbalance: Array = field(metadata=_habit("log ratio", 0.0, 0.15, "chosen"))
    """Circles that come out as ellipses: standard deviation of one axis' gain on the other."""
    drift: Array = field(metadata=_habit("share", 0.0, 0.2, "chosen"))
    """Change of the push from beginning to end (standard deviation)."""
    heading_rad: Array = field(metadata=_habit("rad", 0.03, 0.25, "chosen"))
    """How far the direction set out in is from the one meant (standard deviation)."""
    push: Array = field(metadata=_habit("full stick", 0.45, 0.95, "chosen"))
    """Habitual deflection."""
    dead_band: Array = field(metadata=_habit("full stick", 0.0, 0.06, "common/sticks.py: 0.05"))
    """The pad sends deflections below it as zero."""
    worn: Array = field(metadata=_habit("full stick", 0.0, 0.05, "chosen"))
    """A worn pad's offset from neutral (standard deviation), before the dead band."""
    axis_pull: Array = field(metadata=_habit("share", 0.0, 0.2, "chosen"))
    """0: any direction; 1: only along the pad's axes."""
    steps: Array = field(metadata=_habit("share", 0.0, 0.05, "chosen"))
    """Bang-bang: 0 is smooth, 1 knows only eight directions and full push."""
    hesitation_hz: Array = field(metadata=_habit("1/s", 0.0, 0.1, "chosen"))
    """How often the hand stands still for a moment, in the middle of a shape."""
    correction_hz: Array = field(metadata=_habit("1/s", 0.0, 0.25, "chosen"))
    """How often a short pulse corrects the direction."""
    height_hz: Array = field(metadata=_habit("1/s", 0.0, 0.25, "chosen"))
    """How often a pulse of the other thumb corrects the height."""
    cross_talk: Array = field(metadata=_habit("share", 0.0, 0.05, "chosen"))
    """Leak of a push into the other stick's axes."""
    tap: Array = field(metadata=_habit("share", 0.0, 0.0, "chosen"))
    """Pushes in taps: the share of each tap's period without a push."""
    tap_s: Array = field(metadata=_habit("s", 0.35, 0.8, "chosen"))
    """Period of taps."""
    ramp_s: Array = field(metadata=_habit("s", 0.08, 0.4, "chosen"))
    """Lead-in from neutral and lead-out to it."""
    late_s: Array = field(metadata=_habit("s", 0.0, 0.25, "chosen"))
    """The second thumb starts later."""
    hold: Array = field(metadata=_habit("full stick", 0.0, 0.08, "chosen"))
    """A thumb stays where it is until it should be elsewhere by more than this."""
    decide_s: Array = field(
        metadata=_habit("s", 0.08, 0.35, "refractory 0.25 to 0.55 s, van de Kamp 2013")
    )
    """A pilot renews an aim this often."""
    look_s: Array = field(metadata=_habit("s", 0.2, 0.8, "chosen"))
    """A pilot looks at the height this often."""
    lookahead_s: Array = field(metadata=_habit("s", 0.7, 1.5, "chosen"))
    """How far ahead along a path a pilot aims."""
    gain: Array = field(metadata=_habit("1/s", 1.0, 2.4, "order of McRuer's crossover, recalled"))
    """Rate of turn per bearing to the aim."""
    yaw: Array = field(metadata=_habit("share", 0.0, 0.0, "chosen"))
    """How much of a turn is made by turning the vehicle."""
    strafe: Array = field(metadata=_habit("share", 1.0, 1.0, "chosen"))
    """How much of a sideways aim a pilot answers by a sideways push."""
    vehicle_s: Array = field(metadata=_habit("s", 0.2, 0.7, "chosen, around the tum plant"))
    """Time constant of the vehicle from stick to speed."""
    wind_mps: Array = field(
        metadata=_habit("m/s", 0.01, 0.06, "tum_simulator: noise 0.05, drift 0.03")
    )
    """How hard the air pushes the vehicle about."""
    rate_hz: Array = field(metadata=_habit("Hz", 42.0, 50.0, "thesis 4.1: around 45 Hz"))
    """Of the pad's messages."""
    jitter: Array = field(metadata=_habit("share", 0.02, 0.15, "chosen"))
    """Standard deviation of the interval between two messages."""
    loss: Array = field(metadata=_habit("share", 0.0, 0.02, "chosen"))
    """Messages that never come."""

    def __len__(self) -> int:
        return len(self.reaction_s)

    def take(self, index: NDArray[np.int64]) -> "People":
        """The people at these places, some of them more than once."""
        return People(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def worse(self, difficulty: float) -> "People":
        """The same people, whose execution is worse by a factor."""
        scaled = {name: getattr(self, name) * difficulty for name in EXECUTION}
        return replace(self, **scaled)


EXECUTION = (
    "tremor",
    "signal_noise",
    "wander_rad",
    "warp",
    "imbalance",
    "drift",
    "hesitation_hz",
    "correction_hz",
    "height_hz",
    "cross_talk",
)
"""Habits of bad execution, which a population's difficulty scales (shapes have their own)."""


class Style(Enum):
    """How a person makes a shape."""

    HAND = "hand"
    """Moves the sticks through the shape and does not watch the vehicle."""
    PILOT = "pilot"
    """Watches the vehicle and steers it along the shape."""


Ranges = dict[str, tuple[float, float]]

TRAITS: dict[str, Ranges] = {
    "twitchy": {
        "tremor": (0.02, 0.06),
        "signal_noise": (0.1, 0.22),
        "correction_hz": (0.3, 1.2),
        "lag_s": (0.02, 0.05),
    },
    "sluggish": {
        "reaction_s": (0.25, 0.4),
        "lag_s": (0.1, 0.22),
        "ramp_s": (0.3, 0.9),
        "drift": (0.1, 0.35),
    },
    "stepping": {"steps": (0.35, 0.95), "lag_s": (0.03, 0.08), "push": (0.6, 1.0)},
    "axis-bound": {"axis_pull": (0.3, 0.7), "imbalance": (0.1, 0.35)},
    "hesitant": {"hesitation_hz": (0.15, 0.5), "warp": (0.25, 0.5), "hold": (0.05, 0.15)},
    "sloppy": {
        "bend_rad": (0.15, 0.35),
        "uneven": (0.4, 0.8),
        "wander_rad": (0.1, 0.2),
        "heading_rad": (0.2, 0.45),
    },
    "height-minding": {"height_hz": (0.3, 0.8), "cross_talk": (0.03, 0.1), "late_s": (0.1, 0.6)},
    "tapping": {"tap": (0.25, 0.6), "lag_s": (0.03, 0.07)},
    "timid": {"push": (0.2, 0.45)},
    "reckless": {"push": (0.9, 1.3)},
    "nervous": {
        "gain": (2.0, 3.2),
        "lookahead_s": (0.5, 0.9),
        "reaction_s": (0.15, 0.28),
        "tremor": (0.01, 0.03),
        "hold": (0.0, 0.03),
    },
    "slow-deciding": {"decide_s": (0.25, 0.6), "reaction_s": (0.2, 0.4), "look_s": (0.5, 1.2)},
    "turning": {"yaw": (0.6, 1.0), "strafe": (0.0, 0.2)},
    "half-turning": {"yaw": (0.3, 0.8), "strafe": (0.3, 0.8)},
    "worn-pad": {"worn": (0.04, 0.1), "jitter": (0.1, 0.3), "loss": (0.0, 0.05)},
}
"""Bundles of habits that go together. Ranges are chosen; all of them overlap with ordinary ones or
with each other's."""


@dataclass(frozen=True)
class Family:
    """A kind of people: what all of them have, while each may have any other trait besides.

    Attributes:
        name: of the family.
        style: how a shape is made.
        traits: keys of `TRAITS`.
        odd: how likely each other trait is.
        never: traits that nobody of the family has.
    """

    name: str
    style: Style
    traits: tuple[str, ...] = ()
    odd: float = SECONDARY_SHARE
    never: tuple[str, ...] = ()


FAMILIES: tuple[Family, ...] = (
    Family("steady", Style.HAND),
    Family("twitchy", Style.HAND, ("twitchy",)),
    Family("sluggish", Style.HAND, ("sluggish",)),
    Family("stepping", Style.HAND, ("stepping",)),
    Family("axis-bound", Style.HAND, ("axis-bound",)),
    Family("novice", Style.HAND, ("hesitant", "sloppy", "height-minding")),
    Family("hand-turning", Style.HAND, ("turning",)),
    Family("pilot-yaw", Style.PILOT, ("turning",)),
    Family("pilot-yaw-nervous", Style.PILOT, ("turning", "nervous")),
    Family("pilot-strafe", Style.PILOT),
    Family("pilot-strafe-rough", Style.PILOT, ("slow-deciding", "tapping")),
    Family("pilot-both", Style.PILOT, ("half-turning",)),
)
"""Hands and pilots of the wide population."""


NO_YAW = ("turning", "half-turning")
THESIS_FAMILIES: tuple[Family, ...] = (
    Family("steady", Style.HAND, never=NO_YAW),
    Family("twitchy", Style.HAND, ("twitchy",), never=NO_YAW),
    Family("steady", Style.HAND, never=NO_YAW),
    Family("sluggish", Style.HAND, ("sluggish",), never=NO_YAW),
    Family("axis-bound", Style.HAND, ("axis-bound",), never=NO_YAW),
    Family("steady", Style.HAND, never=NO_YAW),
    Family("novice", Style.HAND, ("hesitant", "sloppy", "height-minding"), never=NO_YAW),
    Family("stepping", Style.HAND, ("stepping",), never=NO_YAW),
    Family("steady", Style.HAND, never=NO_YAW),
    Family("pilot-strafe", Style.PILOT, never=NO_YAW),
)
"""The thesis' operators: mostly hands, and nobody turns the vehicle, for its data have no yaw."""


def draw_people(families: list[Family], rng: np.random.Generator) -> People:
    """One person of each of these families: every habit uniform in the range that holds for it."""
    ordinary: Ranges = {f.name: f.metadata["range"] for f in fields(People)}
    columns: dict[str, list[float]] = {name: [] for name in ordinary}
    for family in families:
        others = [name for name in TRAITS if name not in (*family.traits, *family.never)]
        odd = [name for name in others if rng.random() < family.odd]
        if "turning" in family.traits or "half-turning" in family.traits:
            odd = [name for name in odd if name not in ("turning", "half-turning")]
        ranges = dict(ordinary)
        # The family's own traits come last: they are what it is known by.
        for trait in (*odd, *family.traits):
            ranges |= TRAITS[trait]
        for name, (low, high) in ranges.items():
            columns[name].append(float(rng.uniform(low, high)))
    return People(**{name: np.array(column) for name, column in columns.items()})
