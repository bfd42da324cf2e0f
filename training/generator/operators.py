"""Simulated people: families of hands and pilots, and the operators drawn from them."""

from dataclasses import dataclass, fields
from enum import Enum

import numpy as np


class Style(Enum):
    """How an operator makes a shape."""

    HAND = "hand"
    """Moves the sticks through the shape without watching the vehicle."""
    YAW = "yaw"
    """Watches the vehicle and steers it by yaw and forward."""
    STRAFE = "strafe"
    """Watches the vehicle and pushes it where it is to go, its heading fixed."""


@dataclass(frozen=True)
class Operator:
    """One person. Times in s, noises as fractions of full stick, rates in Hz."""

    reaction_s: float
    """From what is seen or meant to the start of a movement."""
    lag_s: float
    """Time constant of arm and thumb (first order, applied twice)."""
    tremor: float
    """Standard deviation of tremor (8 to 12 Hz in people), whatever the deflection."""
    signal_noise: float
    """Slow noise as a share of the deflection."""
    wander_rad: float
    """Slow wander of the direction of push."""
    dead_band: float
    """Deflections below it are sent as zero by the pad."""
    axis_pull: float
    """0: any direction; 1: only along the axes."""
    steps: float
    """0: smooth; 1: bang-bang, only 0 and full of the level meant."""
    imbalance: float
    """Standard deviation of the ratio between the two axes' gains (log)."""
    drift: float
    """Change of deflection from beginning to end of a primitive (standard deviation)."""
    warp: float
    """Uneven turning: share of the rate of turn."""
    hesitation_hz: float
    """How often the movement stops for a moment."""
    correction_hz: float
    """How often a short pulse corrects the direction."""
    ramp_s: float
    """Lead-in from neutral and lead-out to neutral."""
    cross_talk: float
    """Share of the horizontal stick that leaks into the vertical one."""
    height_hz: float
    """How often a pulse of the vertical stick corrects the height."""
    hold: float
    """A thumb is held still until it should be elsewhere by more than this."""
    lookahead_s: float
    """How far ahead along the path a pilot aims."""
    gain: float
    """Yaw rate per bearing (1/s) of a pilot that steers by yaw."""
    decide_s: float
    """A pilot renews its aim this often."""
    rate_hz: float
    """Of the stick messages."""
    jitter: float
    """Standard deviation of a sample's interval, as a share."""
    loss: float
    """Share of samples lost."""


@dataclass(frozen=True)
class Family:
    """A kind of people: a style and the range of each parameter."""

    name: str
    style: Style
    ranges: dict[str, tuple[float, float]]


_COMMON: dict[str, tuple[float, float]] = {
    "reaction_s": (0.12, 0.3),
    "lag_s": (0.03, 0.1),
    "tremor": (0.004, 0.02),
    "signal_noise": (0.02, 0.09),
    "wander_rad": (0.01, 0.09),
    "dead_band": (0.0, 0.06),
    "axis_pull": (0.0, 0.2),
    "steps": (0.0, 0.0),
    "imbalance": (0.0, 0.12),
    "drift": (0.0, 0.15),
    "warp": (0.0, 0.25),
    "hesitation_hz": (0.0, 0.08),
    "correction_hz": (0.0, 0.15),
    "ramp_s": (0.08, 0.35),
    "cross_talk": (0.0, 0.04),
    "height_hz": (0.0, 0.35),
    "hold": (0.0, 0.06),
    "lookahead_s": (0.8, 1.6),
    "gain": (1.2, 3.0),
    "decide_s": (0.05, 0.2),
    "rate_hz": (44.0, 51.0),
    "jitter": (0.02, 0.15),
    "loss": (0.0, 0.02),
}

FAMILIES: tuple[Family, ...] = (
    Family("smooth", Style.HAND, {}),
    Family(
        "twitchy",
        Style.HAND,
        {
            "tremor": (0.02, 0.06),
            "signal_noise": (0.06, 0.15),
            "correction_hz": (0.3, 1.0),
            "lag_s": (0.02, 0.05),
        },
    ),
    Family(
        "sluggish",
        Style.HAND,
        {"lag_s": (0.12, 0.25), "ramp_s": (0.3, 0.8), "drift": (0.1, 0.3), "warp": (0.1, 0.4)},
    ),
    Family("stepping", Style.HAND, {"steps": (0.35, 0.9), "lag_s": (0.03, 0.1)}),
    Family("axis-bound", Style.HAND, {"axis_pull": (0.25, 0.6), "imbalance": (0.1, 0.3)}),
    Family(
        "novice",
        Style.HAND,
        {
            "hesitation_hz": (0.1, 0.4),
            "correction_hz": (0.2, 0.6),
            "warp": (0.25, 0.5),
            "wander_rad": (0.06, 0.16),
            "cross_talk": (0.03, 0.1),
            "height_hz": (0.2, 0.6),
        },
    ),
    Family("pilot-yaw", Style.YAW, {}),
    Family(
        "pilot-yaw-nervous",
        Style.YAW,
        {
            # With more gain at this delay the loop oscillates: a line becomes a sine.
            "gain": (1.8, 3.2),
            "lookahead_s": (0.7, 1.2),
            "reaction_s": (0.15, 0.3),
            "tremor": (0.01, 0.03),
        },
    ),
    Family("pilot-strafe", Style.STRAFE, {}),
    Family(
        "pilot-strafe-rough",
        Style.STRAFE,
        {
            "lookahead_s": (0.5, 1.0),
            "reaction_s": (0.2, 0.4),
            "axis_pull": (0.0, 0.35),
            "tremor": (0.01, 0.04),
            "decide_s": (0.15, 0.5),
        },
    ),
)


def draw_operator(family: Family, rng: np.random.Generator) -> Operator:
    """One person of a family, each parameter uniform in its range."""
    ranges = _COMMON | family.ranges
    return Operator(**{f.name: float(rng.uniform(*ranges[f.name])) for f in fields(Operator)})
