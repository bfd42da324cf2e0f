"""What the recorder can be told."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Config:
    """Where recordings go and how they are packed."""

    folder: str = "recordings"
    """Made if it is missing; the file in it is named <vehicle>-<time in UTC>.mcap."""
    compression: Literal["zstd", "lz4", "none"] = "zstd"
    """Of each chunk. Zstandard takes back what base64 adds to the pictures."""
    chunk_bytes: int = 1 << 20
    """A chunk is written when it is this full: what a killed process loses at most."""

    def __post_init__(self) -> None:
        if not self.folder:
            raise ValueError("folder is empty; use . for the current one")
        if not 1024 <= self.chunk_bytes <= 1 << 30:
            raise ValueError(f"chunk_bytes is {self.chunk_bytes}; use 1024 to {1 << 30}")
