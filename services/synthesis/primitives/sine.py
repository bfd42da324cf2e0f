"""A level wave about a straight axis.

The principal axis turns the points, a least-squares periodogram (the FFT's sum for unequal steps,
offset and trend fitted with it) starts Levenberg-Marquardt, and the wave is turned back (thesis
3.2.4). The axis itself is a parameter of the second step: over part of a wave the principal axis is
not the wave's.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from common.frames import Array
from services.synthesis.config import Config
from services.synthesis.primitives.plane import turned, turned_back, way_of
from services.synthesis.primitives.shape import (
    EXAMPLE_POINTS,
    MAX_STEPS,
    STEP_M,
    Example,
    Quality,
    Shape,
    UnfitError,
    levenberg_marquardt,
)

WAVES_AHEAD = 3
RMS_SHARE = 0.3
"""Of the amplitude: noise of 10 % in each coordinate is 14 % across the wave."""
MIN_AMPLITUDE_M = 0.05
MIN_WAVES = 0.5
"""Less has no bend to either side; the thesis' data has one inflection at least (4.1)."""
SAME_HEADING_RAD = math.radians(20.0)
SAME_SHARE = 0.3
"""Waves that differ by this share are the same to who flies them by hand."""
_MAX_WAVES = 6.0
_START_WAVES = np.geomspace(0.4, _MAX_WAVES, 20)
_START_POINTS = 45
_START_TURNS_RAD = ((0.0,), (math.radians(-30.0), math.radians(30.0)), (math.radians(90.0),))
"""Axes to start from, against the principal one, until the residual is mere noise."""
_GOOD_START = 1.6
_START_TOLERANCE = 1e-3
_MAX_SLOPE = 10.0


@dataclass(frozen=True)
class Sine(Shape):
    """A wave `amplitude sin(2 pi s / wavelength + phase)` to the left of its axis.

    `s` is the way along the axis from the anchor, which lies beside the vehicle. The `estimate` is
    the wavelength in m.
    """

    name: ClassVar[str] = "sine"
    figures: ClassVar[Mapping[str, str]] = {
        "x": "m",
        "y": "m",
        "z": "m",
        "heading": "rad",
        "amplitude": "m",
        "wavelength": "m",
        "phase": "rad",
    }
    min_points: ClassVar[int] = 8
    steady: ClassVar[bool] = False

    anchor_m: Array
    heading_rad: float
    amplitude_m: float
    wavelength_m: float
    phase_rad: float
    waves: float
    errors: Mapping[str, float]
    """Standard errors by the parameters' names."""

    @classmethod
    def fit(cls, points_m: Array, start_m: Array) -> Self:
        """A wave in the horizontal plane of the points' mean height."""
        xy = points_m[:, :2]
        mean = xy.mean(axis=0)
        wave, covariance = _fit_wave(xy - mean)
        axis_rad, offset, sine, cosine, number = (float(v) for v in wave)
        along, across = turned(xy - mean, axis_rad)
        slope = number * (sine * np.cos(number * along) - cosine * np.sin(number * along))
        off = across - _wave(along, offset, sine, cosine, number)
        off = off / np.hypot(1.0, slope)
        heights = points_m[:, 2]
        rms = math.sqrt(float(np.mean(off**2) + np.var(heights)))

        amplitude = math.hypot(sine, cosine)
        phase = math.atan2(cosine, sine)
        order = np.arange(len(along)) - (len(along) - 1) / 2.0
        sign = 1.0 if along @ order >= 0.0 else -1.0
        if sign < 0.0:
            # Looking the other way both coordinates change sign: -A sin(-k s + p) = A sin(k s - p).
            axis_rad += math.pi
            offset, phase, along = -offset, -phase, -along
        beside = turned(start_m[None, :2] - mean, axis_rad)
        start_along, start_across = float(beside[0][0]), float(beside[1][0])
        heading = math.remainder(axis_rad, 2.0 * math.pi)
        cos, sin = math.cos(heading), math.sin(heading)
        amplitude_var = (
            sine**2 * covariance[2, 2]
            + cosine**2 * covariance[3, 3]
            + 2.0 * sine * cosine * covariance[2, 3]
        ) / max(amplitude**2, 1e-12)
        wavelength = 2.0 * math.pi / number
        wavelength_doubt = math.sqrt(max(float(covariance[4, 4]), 0.0)) / number
        extent = float(np.ptp(along))
        # Derivatives of the axis' place and of the phase beside the vehicle.
        shift = np.array([sign * start_along, 1.0, 0.0, 0.0, 0.0])
        offset_std = math.sqrt(max(float(shift @ covariance @ shift), 0.0))
        square = max(amplitude**2, 1e-12)
        turn = np.array(
            [number * start_across, 0.0, -sign * cosine / square, sign * sine / square, start_along]
        )
        return cls(
            quality=Quality(
                rms_m=rms,
                extent_m=extent,
                count=len(along),
                estimate=wavelength,
                estimate_std=wavelength_doubt * wavelength,
                doubt=max(
                    wavelength_doubt, math.sqrt(max(amplitude_var, 0.0)) / max(amplitude, 1e-9)
                ),
            ),
            anchor_m=np.array(
                [
                    mean[0] + cos * start_along - sin * offset,
                    mean[1] + sin * start_along + cos * offset,
                    float(heights.mean()),
                ]
            ),
            heading_rad=heading,
            amplitude_m=amplitude,
            wavelength_m=wavelength,
            phase_rad=math.remainder(phase + number * start_along, 2.0 * math.pi),
            waves=extent / wavelength,
            errors={
                "x": abs(sin) * offset_std,
                "y": abs(cos) * offset_std,
                "z": float(heights.std()) / math.sqrt(len(heights)),
                "heading": math.sqrt(max(float(covariance[0, 0]), 0.0)),
                "amplitude": math.sqrt(max(amplitude_var, 0.0)),
                "wavelength": wavelength_doubt * wavelength,
                "phase": min(math.sqrt(max(float(turn @ covariance @ turn), 0.0)), math.pi),
            },
        )

    @property
    def params(self) -> dict[str, float]:
        """The axis beside the vehicle, and the wave from there on."""
        x, y, z = (float(v) for v in self.anchor_m)
        return {
            "x": x,
            "y": y,
            "z": z,
            "heading": self.heading_rad,
            "amplitude": self.amplitude_m,
            "wavelength": self.wavelength_m,
            "phase": self.phase_rad,
        }

    @property
    def stds(self) -> dict[str, float]:
        """Of every parameter."""
        return dict(self.errors)

    @property
    def tolerances(self) -> dict[str, float]:
        """The axis' direction, and shares of the wave's size; its place and phase move on."""
        return {
            "heading": SAME_HEADING_RAD,
            "amplitude": SAME_SHARE * self.amplitude_m,
            "wavelength": SAME_SHARE * self.wavelength_m,
        }

    @classmethod
    def example(
        cls, rng: np.random.Generator, extent: float, count: int = EXAMPLE_POINTS
    ) -> Example:
        """Any wave in any direction that can be flown; `extent` in waves."""
        # Crests of 0.33 m radius at least, as the tightest arcs.
        amplitude, curvature = rng.uniform(0.2, 0.8), rng.uniform(0.8, 3.0)
        wavelength = 2.0 * math.pi * math.sqrt(amplitude / curvature)
        heading, phase = rng.uniform(-math.pi, math.pi, 2)
        anchor = np.array([*rng.uniform(-10.0, 10.0, 2), rng.uniform(1.0, 3.0)])
        along = np.linspace(0.0, extent * wavelength, count)
        across = amplitude * np.sin(2.0 * math.pi * along / wavelength + phase)
        way = np.column_stack([turned_back(along, across, heading), np.zeros(len(along))])
        beside = anchor + along[-1] * np.array([math.cos(heading), math.sin(heading), 0.0])
        return Example(
            anchor + way,
            {
                **dict(zip("xyz", (float(v) for v in beside), strict=True)),
                "heading": heading,
                "amplitude": amplitude,
                "wavelength": wavelength,
                "phase": math.remainder(phase + 2.0 * math.pi * extent, 2.0 * math.pi),
            },
        )

    @property
    def rms_limit_m(self) -> float:
        """A share of the amplitude."""
        return RMS_SHARE * self.amplitude_m

    def check(self, config: Config) -> None:
        """Refuse what cannot be told from a line, and less than half a wave."""
        if self.amplitude_m < MIN_AMPLITUDE_M:
            raise UnfitError(f"its amplitude is only {self.amplitude_m:.2f} m", "line")
        if self.waves < MIN_WAVES:
            raise UnfitError(f"only {self.waves:.2f} waves of it were flown")

    def ahead(self) -> Array:
        """The next three waves."""
        dense = np.linspace(0.0, WAVES_AHEAD * self.wavelength_m, 128 * WAVES_AHEAD + 1)
        length = way_of(np.column_stack([dense, self._across(dense)]))
        steps = min(max(round(float(length[-1]) / STEP_M), 32 * WAVES_AHEAD), MAX_STEPS)
        along = np.interp(np.linspace(0.0, length[-1], steps + 1), length, dense)
        xy = self.anchor_m[:2] + turned_back(along, self._across(along), self.heading_rad)
        return np.column_stack([xy, np.full_like(along, self.anchor_m[2])])

    def _across(self, along: Array) -> Array:
        number = 2.0 * math.pi / self.wavelength_m
        return np.asarray(self.amplitude_m * np.sin(number * along + self.phase_rad))


def _wave(along: Array, offset: float, sine: float, cosine: float, number: float) -> Array:
    return np.asarray(offset + sine * np.sin(number * along) + cosine * np.cos(number * along))


def _first_guesses(xy: Array, axis_rad: float) -> list[tuple[float, Array]]:
    """Waves to start from, with their mean squares, for one guess of the axis.

    For each wave number the best offset, trend, sine and cosine are linear; the trend turns the
    axis.
    """
    along, across = turned(xy, axis_rad)
    extent = float(np.ptp(along))
    numbers = 2.0 * math.pi * _START_WAVES / extent
    phases = np.outer(numbers, along)
    basis = np.empty((len(numbers), 4, len(along)))
    basis[:, 0] = 1.0
    basis[:, 1] = along / extent
    np.sin(phases, out=basis[:, 2])
    np.cos(phases, out=basis[:, 3])
    normal = basis @ basis.transpose(0, 2, 1)
    normal += 1e-6 * len(along) * np.eye(4)
    weights = np.linalg.solve(normal, (basis @ across)[..., None])
    off = across - (weights.transpose(0, 2, 1) @ basis)[:, 0]
    misfit = np.mean(off**2, axis=1)
    padded = np.concatenate([[np.inf], misfit, [np.inf]])
    guesses = []
    for index in np.flatnonzero((misfit <= padded[:-2]) & (misfit <= padded[2:])):
        offset, trend, sine, cosine = (float(v) for v in weights[index, :, 0])
        turn = math.atan(trend / extent)
        wave = np.array([axis_rad + turn, offset, sine, cosine, float(numbers[index])])
        guesses.append((float(misfit[index]), wave))
    return guesses


class _Wave:
    """Residuals of points (N, 2) from a wave, and their derivatives.

    A wave is its axis (rad), offset, sine and cosine amplitudes (m) and wave number (1/m).
    """

    def __init__(self, xy: Array) -> None:
        self._x, self._y = xy.T
        self._key = b""
        self._parts: tuple[Array, ...] = ()

    def across_it(self, wave: Array) -> Array:
        """Distances (N,) from the wave, across its axis."""
        return self._of(wave)[-1]

    def across_slopes(self, wave: Array) -> Array:
        """Their derivatives (5, N)."""
        along, across, s, c, _, tilt, _ = self._of(wave)
        slopes = np.empty((5, len(s)))
        slopes[0] = -along - wave[4] * tilt * across
        slopes[1] = -1.0
        np.negative(s, out=slopes[2])
        np.negative(c, out=slopes[3])
        slopes[4] = -along * tilt
        return slopes

    def off_it(self, wave: Array) -> Array:
        """Distances (N,) from the wave's tangents."""
        *_, tilt, off = self._of(wave)
        return np.asarray(off / np.sqrt(1.0 + (wave[4] * tilt) ** 2))

    def off_slopes(self, wave: Array) -> Array:
        """Their derivatives (5, N)."""
        number = wave[4]
        along, across, s, c, lift, tilt, off = self._of(wave)
        slope = number * tilt
        steep = np.sqrt(1.0 + slope**2)
        bend = -number * lift
        of_slope = np.empty((5, len(s)))
        of_slope[0] = number * bend * across
        of_slope[1] = 0.0
        of_slope[2] = number * c
        of_slope[3] = -number * s
        of_slope[4] = tilt + bend * along
        return np.asarray((self.across_slopes(wave) - off * slope / steep**2 * of_slope) / steep)

    def _of(self, wave: Array) -> tuple[Array, ...]:
        # Residuals and derivatives are asked for at the same wave, one after the other.
        key = wave.tobytes()
        if key != self._key:
            axis, offset, sine, cosine, number = wave.tolist()
            cos, sin = math.cos(axis), math.sin(axis)
            along = cos * self._x + sin * self._y
            across = cos * self._y - sin * self._x
            phase = number * along
            s, c = np.sin(phase), np.cos(phase)
            lift, tilt = sine * s + cosine * c, sine * c - cosine * s
            self._key = key
            self._parts = along, across, s, c, lift, tilt, across - offset - lift
        return self._parts


def _noise(xy: Array) -> float:
    """Standard deviation of the points' own noise: what neighbours do not share, in m."""
    third = np.diff(xy, n=3, axis=0)
    return math.sqrt(float(np.mean(third**2)) / 20.0) if len(third) else 0.0


def _fit_wave(xy: Array) -> tuple[Array, Array]:
    """Axis (rad), offset, sine and cosine amplitudes, wave number of centred points (N, 2).

    Returns:
        these five, and their covariance if the points' errors are independent.

    Raises:
        UnfitError: if no wave is determined.
    """
    _, singular, axes = np.linalg.svd(xy, full_matrices=False)
    if singular[0] <= 1e-9:
        raise UnfitError("all points are the same")
    principal = math.atan2(axes[0, 1], axes[0, 0])
    thin = xy[:: max(1, len(xy) // _START_POINTS)]
    noise_m = _noise(xy)
    model = _Wave(xy)

    best: tuple[float, Array] | None = None
    for turns in _START_TURNS_RAD:
        guesses = [guess for turn in turns for guess in _first_guesses(thin, principal + turn)]
        guesses.sort(key=lambda guess: guess[0])
        for _, guess in guesses[:2]:
            try:
                wave, _, _ = levenberg_marquardt(
                    model.across_it, model.across_slopes, guess, _START_TOLERANCE
                )
            except UnfitError:
                continue
            off_m = math.sqrt(float(np.mean(model.off_it(wave) ** 2)))
            if wave[4] > 0.0 and (best is None or off_m < best[0]):
                best = off_m, wave
            if off_m < _GOOD_START * noise_m:
                break
        if best is not None and best[0] < _GOOD_START * noise_m:
            break
    if best is None:
        raise UnfitError("the points do not determine a wave")
    # Errors lie in both directions, so the distance to the wave's tangent counts. Where a wave is
    # hardly known, that can be made small by mere steepness.
    wave, covariance, _ = levenberg_marquardt(model.off_it, model.off_slopes, best[1])
    if wave[4] <= 0.0 or wave[4] * math.hypot(wave[2], wave[3]) > _MAX_SLOPE:
        raise UnfitError("the points do not determine a wave")
    return wave, covariance
