"""Hidden truths for the fits: motions whose parameters are known, poses and intents of them."""

import math
from collections.abc import Callable

import numpy as np

from common.frames import Array, quaternion_of
from common.messages import Intent, Pose

S = 1_000_000_000
POSE_RATE_HZ = 100.0


def noisy(points: Array, sigma_m: float, rng: np.random.Generator) -> Array:
    return np.asarray(points + rng.normal(0.0, sigma_m, points.shape))


def arc_points(
    cx: float, cy: float, z: float, radius: float, begin: float, sweep: float, count: int = 90
) -> Array:
    angles = begin + np.linspace(0.0, sweep, count)
    return np.column_stack(
        [cx + radius * np.cos(angles), cy + radius * np.sin(angles), np.full(count, z)]
    )


def helix_points(radius: float, begin: float, sweep: float, pitch: float, count: int = 90) -> Array:
    points = arc_points(1.0, -2.0, 2.0, radius, begin, sweep, count)
    points[:, 2] += pitch * np.linspace(0.0, abs(sweep), count) / (2.0 * math.pi)
    return points


def sine_points(
    amplitude: float,
    wavelength: float,
    heading: float,
    phase: float,
    waves: float,
    count: int = 90,
) -> Array:
    """About (3, -2), height 1; `phase` is that of the first point."""
    along = np.linspace(0.0, waves * wavelength, count)
    across = amplitude * np.sin(2.0 * math.pi * along / wavelength + phase)
    cos, sin = math.cos(heading), math.sin(heading)
    return np.column_stack(
        [3.0 + cos * along - sin * across, -2.0 + sin * along + cos * across, np.ones(count)]
    )


def wave_from(params: dict[str, float], along: Array) -> Array:
    """The wave that a suggestion's parameters describe, read as the contract says."""
    across = params["amplitude"] * np.sin(
        2.0 * math.pi * along / params["wavelength"] + params["phase"]
    )
    cos, sin = math.cos(params["heading"]), math.sin(params["heading"])
    return np.column_stack(
        [
            params["x"] + cos * along - sin * across,
            params["y"] + sin * along + cos * across,
            np.full_like(along, params["z"]),
        ]
    )


def pose(position: Array, yaw: float = 0.0, t_s: float = 0.0, status: str = "ok") -> Pose:
    x, y, z = (float(v) for v in position)
    qx, qy, qz, qw = quaternion_of(0.0, 0.0, yaw)
    return Pose(
        stamp=round(t_s * S),
        seq=0,
        position=(x, y, z),
        orientation=(qx, qy, qz, qw),
        velocity=(0.0, 0.0, 0.0),
        angular_velocity=(0.0, 0.0, 0.0),
        covariance=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        status=status,  # type: ignore[arg-type]
        source="test",
    )


def poses(
    where: Callable[[float], Array], duration_s: float, yaw: float = 0.0
) -> list[tuple[Pose, int]]:
    """Poses of a motion and their arrival times, the first at 1 s."""
    count = round(duration_s * POSE_RATE_HZ)
    return [
        (pose(where(i / POSE_RATE_HZ), yaw, i / POSE_RATE_HZ), S + round(i * S / POSE_RATE_HZ))
        for i in range(count + 1)
    ]


def intent(label: str, window_s: float = 2.0, confidence: float = 0.9) -> Intent:
    """What an operator's clock, far from ours, says."""
    primitives = ("line", "arc", "sine", "helix")
    if label in primitives:
        rest = (1.0 - confidence) / 3.0
        probabilities = {name: confidence if name == label else rest for name in primitives}
    else:
        probabilities = dict.fromkeys(primitives, 0.25)
    end = 77_000 * S
    return Intent(
        stamp=end,
        seq=0,
        label=label,
        probabilities=probabilities,
        confidence=confidence,
        window_start=end - round(window_s * S),
        window_end=end,
        samples=100,
        model="test-0000",
    )
