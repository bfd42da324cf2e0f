"""Configuration of the operator service."""

import math
from dataclasses import dataclass
from typing import Literal

from services.operator.profiles import PROFILES

Source = Literal["auto", "pad", "keyboard", "console", "scripted"]


@dataclass(frozen=True)
class Config:
    """Who flies, with what hands, and for the scripted operator: what mission."""

    source: Source = "auto"
    """`auto` is the pad while there is one, else the browser's. The browser's always wins."""
    pad: str = ""
    """Profile of the pad (ps3, xbox, generic); empty: by the pad's name."""
    dead_band: float = 0.1
    """Deflections of a pad's axis up to this count as none; worn pads rest at up to 0.1."""
    world: str = "track"
    """Whose route the scripted operator flies."""
    laps: int = 1
    """Laps of the scripted mission; 0: for ever."""
    accepts: bool = True
    """Whether the scripted operator accepts suggestions, or flies everything by hand."""
    speed_mps: float = 0.85
    """What the scripted operator flies at."""
    height_m: float = 0.0
    """Added to the route's own height by the scripted operator."""
    reaction_s: float = 0.25
    """From something to be seen to the scripted hand's first movement."""
    tremor: float = 0.015
    """Standard deviation of the scripted hand's tremor, as a fraction of full stick."""
    seed: int = 1
    """Of the scripted operator's noise: the same seed is the same person on the same day."""

    def __post_init__(self) -> None:
        if self.pad and self.pad not in PROFILES:
            raise ValueError(f"pad must be one of {', '.join(PROFILES)}, not {self.pad!r}")
        if not 0.0 <= self.dead_band < 0.5:
            raise ValueError("dead_band must be in [0, 0.5)")
        if self.laps < 0:
            raise ValueError("laps must be >= 0")
        if not 0.1 <= self.speed_mps <= 3.0:
            raise ValueError("speed_mps must be in [0.1, 3]")
        if not math.isfinite(self.height_m):
            raise ValueError("height_m must be finite")
        if not 0.05 <= self.reaction_s <= 2.0:
            raise ValueError("reaction_s must be in [0.05, 2]")
        if not 0.0 <= self.tremor <= 0.2:
            raise ValueError("tremor must be in [0, 0.2]")
        if self.seed < 0:
            raise ValueError("seed must be >= 0")
