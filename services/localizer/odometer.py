"""Way and speed over the floor: pictures against a key picture, and when to take a new key."""

import math

import numpy as np

from common.frames import wrap_angle
from services.localizer.config import Config
from services.localizer.filter import ErrorStateFilter, Snapshot
from services.localizer.flow import Key, Picture
from services.localizer.ground import LEAST_HEIGHT_M, LEAST_POINTS, View, displacement

GATE = 13.8
"""Of the squared Mahalanobis length, two degrees of freedom: one good measurement in 1000."""
REFUSALS = 8
"""A quarter of a second of refused flow means that it is the filter that is wrong."""
UNKNOWN_SPEED_MPS = 1.0
OUTLIER_PX = 1.0
"""Spots that differ by less are never outliers."""
KEY_KEPT = 0.6
"""Share of the key's corners that must still be found."""
KEY_TURN_RAD = 0.2
KEY_CLIMB = 0.12
"""Share of the height: beyond, the key's texture is too much larger or smaller to be matched."""


class Odometer:
    """Corrects a filter by what the downward camera sees.

    Args:
        config: the flow's noises, the number of corners.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._key: Key | None = None
        self._refused = 0

    def forget(self) -> None:
        """Take a new key at the next picture."""
        self._key = None

    def use(self, state: ErrorStateFilter, picture: Picture, floor_m: float) -> bool:
        """Correct by a picture; whether it could be used.

        Args:
            state: the filter, which also holds the key picture's pose.
            picture: not older than what the filter remembers.
            floor_m: the floor's height in the world.
        """
        before = state.at(picture.capture_ns)
        if before is None or before.position_m[2] - floor_m < LEAST_HEIGHT_M:
            self._key = None
            return False
        used, good = False, False
        if self._key is not None:
            used, good = self._compare(state, self._key, picture, before, floor_m)
        if not good:
            self._take_key(state, picture, floor_m)
        return used

    def _compare(
        self,
        state: ErrorStateFilter,
        key: Key,
        picture: Picture,
        here: Snapshot,
        floor_m: float,
    ) -> tuple[bool, bool]:
        """Correct by the key; whether that could be done, and whether the key is good for more."""
        then = View.of_body(state.key_position_m, state.key_rotation, floor_m)
        now = View.of_body(here.position_m, here.rotation, floor_m)
        if min(now.height_m, then.height_m) < LEAST_HEIGHT_M / 2:
            return False, False
        offsets, _ = then.to_floor(key.rays)
        optical = now.of_floor(then.centre_m + offsets)
        ahead = optical[:, 2] > LEAST_HEIGHT_M / 4
        if np.count_nonzero(ahead) < LEAST_POINTS:
            return False, False
        expected = np.full((len(key.rays), 2), -1.0)
        expected[ahead] = picture.pixels(optical[ahead])
        found, ok = key.follow(picture, expected)
        if np.count_nonzero(ok) < LEAST_POINTS:
            return False, False
        pixel_m = now.height_m / picture.focal_px
        age_s = state.age_s(picture.capture_ns)
        seen = displacement(
            then, key.rays[ok], now, picture.rays(found[ok]), age_s, OUTLIER_PX * pixel_m
        )
        if seen is None:
            return False, False
        variance = (self._config.flow_noise_px * pixel_m) ** 2 + seen.spread_m**2 / seen.inliers
        noise = np.eye(2) * variance
        if state.surprise(seen.residual_m, seen.jacobian, noise) > GATE:
            self._refused += 1
            if self._refused < REFUSALS:
                return False, True
            self._refused = 0
            state.loosen(UNKNOWN_SPEED_MPS)
            return False, False
        self._refused = 0
        state.correct(seen.residual_m, seen.jacobian, noise)
        turn = abs(wrap_angle(state.yaw_rad - _yaw_of(then)))
        good = (
            seen.inliers >= KEY_KEPT * len(key.rays)
            and turn < KEY_TURN_RAD
            and abs(now.height_m / then.height_m - 1.0) < KEY_CLIMB
        )
        return True, good

    def _take_key(self, state: ErrorStateFilter, picture: Picture, floor_m: float) -> None:
        """Measure later displacements against this picture."""
        snapshot = state.at(picture.capture_ns)
        key = Key(picture, self._config.flow_corners)
        if snapshot is None or len(key.rays) < LEAST_POINTS:
            self._key = None
            return
        moved_m = 0.0
        if self._key is not None:
            moved_m = float(np.linalg.norm((snapshot.position_m - state.key_position_m)[:2]))
        pixel_m = max(float(snapshot.position_m[2]) - floor_m, 0.0) / picture.focal_px
        config = self._config
        state.set_key(
            snapshot,
            math.hypot(config.flow_noise_px * pixel_m, config.flow_scale_noise * moved_m),
        )
        self._key = key


def _yaw_of(view: View) -> float:
    """The heading of a view's body: the top of the picture, optical -y, is ahead."""
    ahead = -view.world_from_optical[:, 1]
    return math.atan2(ahead[1], ahead[0])
