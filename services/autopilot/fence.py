"""The space that the autopilot may fly in: a cylinder about the world's origin."""

import numpy as np

from common.frames import Array
from services.autopilot.config import Config

MARGIN_M = 0.5
"""Flight may leave by so much what holds the path: no vehicle flies a path exactly."""


class Fence:
    """Tells what lies inside.

    Args:
        config: its radius and heights.
    """

    def __init__(self, config: Config) -> None:
        self._config = config

    def holds(self, points_m: Array) -> bool:
        """Whether all points (N, 3) of a path lie inside."""
        config = self._config
        away = np.hypot(points_m[:, 0], points_m[:, 1]).max()
        low, high = points_m[:, 2].min(), points_m[:, 2].max()
        return bool(
            away <= config.fence_radius_m
            and config.min_height_m <= low
            and high <= config.max_height_m
        )

    def is_left(self, position_m: tuple[float, float, float]) -> bool:
        """Whether a vehicle is too far out, too low or too high to go on."""
        config = self._config
        x, y, z = position_m
        return bool(
            np.hypot(x, y) > config.fence_radius_m + MARGIN_M
            or not config.min_height_m <= z <= config.max_height_m + MARGIN_M
        )
