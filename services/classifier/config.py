"""Configuration of the classifier."""

from dataclasses import dataclass
from pathlib import Path

SHIPPED_MODEL = Path(__file__).resolve().parents[2] / "models" / "intent.onnx"
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 0.1, 1.0


@dataclass(frozen=True)
class Config:
    """What can be set of the classifier."""

    model: str = str(SHIPPED_MODEL)
    """The ONNX file (see docs/model.md); replaced while it runs, the new one is taken."""
    period_s: float = 1.0
    """T of the thesis: how often an intent is published, 0.1 to 1 s."""
    confidence_min: float | None = None
    """A lower confidence is answered by `none`; by default the value calibrated with the model."""
    full_stick_yaw_radps: float | None = None
    """The vehicle's yaw rate at full stick; by default that of the plant that `vehicle` names."""

    def __post_init__(self) -> None:
        if not SHORTEST_PERIOD_S <= self.period_s <= LONGEST_PERIOD_S:
            raise ValueError(
                f"period_s is {self.period_s}; use {SHORTEST_PERIOD_S} to {LONGEST_PERIOD_S} s"
            )
        if self.confidence_min is not None and not 0.0 <= self.confidence_min <= 1.0:
            raise ValueError(f"confidence_min is {self.confidence_min}; use 0 to 1")
        yaw_radps = self.full_stick_yaw_radps
        if yaw_radps is not None and not 0.0 <= yaw_radps <= 20.0:
            raise ValueError(f"full_stick_yaw_radps is {yaw_radps}; use 0 to 20")
