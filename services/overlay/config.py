"""What the overlay draws and where its console listens."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Config:
    """Configuration of the overlay."""

    console_host: str = "0.0.0.0"
    """Address that the console listens on."""
    console_port: int = 8080
    """Port of the console's page; 0 switches the console off."""
    jpeg_quality: int = 80
    """Of `overlay/front`, 1..100."""
    drawn_m: float = 15.0
    """How far ahead along the path arrows are drawn."""
    below_m: float = 0.3
    """Arrows lie this far below the path: at eye height one would see them edge on."""

    def __post_init__(self) -> None:
        if not 0 <= self.console_port <= 65535:
            raise ValueError("console_port: must be 0..65535")
        if not 1 <= self.jpeg_quality <= 100:
            raise ValueError("jpeg_quality: must be 1..100")
        if not 1.0 <= self.drawn_m <= 100.0:
            raise ValueError("drawn_m: must be 1..100")
        if not 0.0 <= self.below_m <= 2.0:
            raise ValueError("below_m: must be 0..2")
