"""What a person may set about synthesis."""

from dataclasses import dataclass
from typing import Literal

from common import fence


@dataclass(frozen=True)
class Config:
    """Limits of what is suggested; every one of them refuses rather than guesses."""

    min_speed_mps: float = 0.3
    """Suggested speeds are not below this, in m/s."""
    max_speed_mps: float = 1.0
    """Suggested speeds are not above this, in m/s: full stick of the `tum` plant."""
    cruise_mps: float = 0.8
    """Speed of a `synthesis/fit` answer whose request names none, in m/s."""
    min_extent_m: float = 0.5
    """A motion shorter than this says too little, in m."""
    min_radius_m: float = 0.3
    """The tightest arc or helix that is suggested, in m: about the vehicle's half diagonal."""
    max_radius_m: float = 15.0
    """The widest arc or helix that is suggested, in m."""
    max_doubt: float = 0.25
    """Largest relative standard error of the parameter that a shape stands or falls by."""
    primitives: Literal["thesis", "extended"] = "thesis"
    """The thesis' four, or spirals, eights, zigzags and compounds of lines and arcs as well."""

    fence_radius_m: float = fence.RADIUS_M
    """Paths end before this level distance from the world's origin, in m."""
    min_height_m: float = fence.MIN_HEIGHT_M
    """Paths end before they go below this height, in m above the world's origin."""
    max_height_m: float = fence.MAX_HEIGHT_M
    """Paths end before they go above this height, in m above the world's origin."""
    half_width_m: float = 0.27
    """Half the vehicle's width, in m: that of the AR.Drone with its hull."""
    margin_m: float = 0.15
    """Kept between the vehicle's side and the world's bodies, in m: the follower's error."""
    max_position_std_m: float = 1.0
    """Where the vehicle's place is not known to this, bodies are not looked for, in m."""

    def __post_init__(self) -> None:
        if not 0.0 < self.min_speed_mps <= self.max_speed_mps:
            raise ValueError("min_speed_mps must be above 0 and at most max_speed_mps")
        if not self.min_speed_mps <= self.cruise_mps <= self.max_speed_mps:
            raise ValueError("cruise_mps must lie between min_speed_mps and max_speed_mps")
        if self.min_extent_m <= 0.0:
            raise ValueError("min_extent_m must be above 0")
        if not 0.0 < self.min_radius_m < self.max_radius_m:
            raise ValueError("min_radius_m must be above 0 and below max_radius_m")
        if self.fence_radius_m <= 0.0:
            raise ValueError("fence_radius_m must be above 0")
        if not self.min_height_m < self.max_height_m:
            raise ValueError("min_height_m must be below max_height_m")
        for field in ("half_width_m", "margin_m", "max_position_std_m"):
            if getattr(self, field) < 0.0:
                raise ValueError(f"{field} must not be below 0")
        if not 0.0 < self.max_doubt <= 1.0:
            raise ValueError("max_doubt must be above 0 and at most 1")
