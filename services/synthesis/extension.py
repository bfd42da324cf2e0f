"""Shapes beyond the thesis' four: what the classifier cannot name, geometry may tell.

They are looked for in the whole way since the vehicle last rested, which is longer than any window
of the classifier. One is offered if it may be flown, and explains that way at least twice as well
as each of the four: half their distance from it, or less.
"""

import math

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.fitting import MIN_ERROR_M, check, fit, inflation
from services.synthesis.history import CELL_M
from services.synthesis.primitives import EXTENDED, PRIMITIVES
from services.synthesis.primitives.shape import Shape, UnfitError

BETTER = 0.5
"""Largest share of the four's residual that an extended shape may have."""
PARTS = (1.0, 0.7, 0.5)
"""Shares of the way, newest part, that are tried: it may begin as something else."""
MIN_WAY_M = 6.0
"""Less cannot hold a repetition of anything."""


def extended_shape(points_m: Array, here_m: Array, config: Config) -> Shape | None:
    """The extended shape of a way (N, 3), if it has one.

    Args:
        points_m: (N, 3), `CELL_M` apart, oldest first.
        here_m: where the vehicle is (3,).
        config: the limits.
    """
    for share in PARTS:
        part = points_m[-round(share * len(points_m)) :]
        if len(part) * CELL_M < MIN_WAY_M:
            return None
        limit_m = BETTER * min(_rms_m(primitive, part, here_m) for primitive in PRIMITIVES.values())
        for primitive in EXTENDED.values():
            try:
                shape = fit(primitive, part, here_m)
                check(shape, config, inflation(shape))
            except UnfitError:
                continue
            if max(shape.quality.rms_m, MIN_ERROR_M) <= limit_m:
                return shape
    return None


def _rms_m(primitive: type[Shape], points_m: Array, here_m: Array) -> float:
    try:
        return fit(primitive, points_m, here_m).quality.rms_m
    except UnfitError:
        return math.inf
