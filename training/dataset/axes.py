"""Which axis of a file is which stick."""

from collections.abc import Sequence
from dataclasses import dataclass

STICKS = ("vx", "vy", "vz", "wz")
SKIPPED = "_"
JOY_AXES = "vy,vx,wz,vz"
"""A PS3 pad's axes 0 to 3: of the left stick, then of the right one; left and up positive."""
SAMPLE_AXES = "vy,vx,vz"
"""The original set's columns a b c are the axes 0, 1 and 3 of such a pad."""


@dataclass(frozen=True)
class Axes:
    """Where sticks are among a file's axes.

    Attributes:
        columns: for each of the file's axes the index of its stick, or None.
        signs: for each of the file's axes what it is multiplied with.
    """

    columns: tuple[int | None, ...]
    signs: tuple[float, ...]

    def sticks(self, values: Sequence[float]) -> tuple[float, float, float, float]:
        """Vx vy vz wz of a row of axes; what the file lacks is 0.

        Raises:
            ValueError: if there are fewer axes than named.
        """
        if len(values) < len(self.columns):
            raise ValueError(
                f"{len(values)} axes, but --axes names {len(self.columns)}; name the file's own"
            )
        sticks = [0.0, 0.0, 0.0, 0.0]
        # Other axes than those named are triggers and the like.
        for value, column, sign in zip(values, self.columns, self.signs, strict=False):
            if column is not None:
                sticks[column] = sign * value
        vx, vy, vz, wz = sticks
        return vx, vy, vz, wz


def parse_axes(text: str) -> Axes:
    """Axes from text such as `vy,vx,_,-vz`.

    Raises:
        ValueError: if a name is unknown or there twice.
    """
    columns: list[int | None] = []
    signs = []
    for word in text.split(","):
        name = word.strip().removeprefix("-")
        if name != SKIPPED and name not in STICKS:
            raise ValueError(
                f"no stick {word.strip()!r}; name the file's axes in their order,"
                f" for example {JOY_AXES}, {SKIPPED} for one to skip, - to turn one around"
            )
        column = None if name == SKIPPED else STICKS.index(name)
        if column is not None and column in columns:
            raise ValueError(f"stick {name} is named twice")
        columns.append(column)
        signs.append(-1.0 if word.strip().startswith("-") else 1.0)
    return Axes(tuple(columns), tuple(signs))
