"""Configuration of the classifier."""

from dataclasses import dataclass
from pathlib import Path

SHIPPED_MODEL = Path(__file__).resolve().parents[2] / "models" / "intent.onnx"
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 0.1, 1.0


@dataclass(frozen=True)
class Config:
    """What can be set of the classifier."""

    model: str = str(SHIPPED_MODEL)
    """The ONNX file (see docs/model.md)."""
    period_s: float = 1.0
    """T of the thesis: how often an intent is published, 0.1 to 1 s."""
    confidence_min: float = 0.6
    """Below this probability of the likeliest primitive the answer is `none`."""
    motion_min_s: float = 0.8
    """A shorter motion has no shape yet."""
    full_stick_yaw_radps: float = 1.0
    """The vehicle's yaw rate at full stick, to see through turns of the heading."""

    def __post_init__(self) -> None:
        if not SHORTEST_PERIOD_S <= self.period_s <= LONGEST_PERIOD_S:
            raise ValueError(
                f"period_s is {self.period_s}; use {SHORTEST_PERIOD_S} to {LONGEST_PERIOD_S} s"
            )
        if not 0.0 <= self.confidence_min <= 1.0:
            raise ValueError(f"confidence_min is {self.confidence_min}; use 0 to 1")
        if not 0.2 <= self.motion_min_s <= 4.0:
            raise ValueError(f"motion_min_s is {self.motion_min_s}; use 0.2 to 4 s")
        if not 0.0 <= self.full_stick_yaw_radps <= 20.0:
            raise ValueError(f"full_stick_yaw_radps is {self.full_stick_yaw_radps}; use 0 to 20")
