"""What a person may set about synthesis."""

from dataclasses import dataclass


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
    min_height_m: float = 0.3
    """A path is cut where it goes below this height, in m above the world's origin."""

    def __post_init__(self) -> None:
        if not 0.0 < self.min_speed_mps <= self.max_speed_mps:
            raise ValueError("min_speed_mps must be above 0 and at most max_speed_mps")
        if not self.min_speed_mps <= self.cruise_mps <= self.max_speed_mps:
            raise ValueError("cruise_mps must lie between min_speed_mps and max_speed_mps")
        if self.min_extent_m <= 0.0:
            raise ValueError("min_extent_m must be above 0")
        if not 0.0 < self.min_radius_m < self.max_radius_m:
            raise ValueError("min_radius_m must be above 0 and below max_radius_m")
        if not 0.0 < self.max_doubt <= 1.0:
            raise ValueError("max_doubt must be above 0 and at most 1")
