"""Pilots who watch the vehicle and steer it along a path, by yaw or by strafing."""

import math
from collections import deque

import numpy as np

from training.generator.hands import STEP_S, height_pulses, on_pad, slow_noise, towards_axes, tremor
from training.generator.operators import Operator, Style
from training.generator.shapes import PATH_STEP_M, Array, PathPlan

VELOCITY_LAG_S = 0.4
"""Of the simulated vehicle from stick to speed."""
FULL_UP_MPS = 0.5
FULL_YAW_RADPS = 1.0
PLANT_NOISE = 0.03
"""Drift of the vehicle's speed, redrawn slowly (tum_simulator's command drift), in m/s."""
HEIGHT_GAIN = 0.7


def pilot(
    plan: PathPlan, who: Operator, style: Style, duration_s: float, rng: np.random.Generator
) -> Array:
    """Sticks (N, 4) at `STEP_S` of a pilot who flies a plan and corrects what is seen.

    Full stick is 1 m/s, 0.5 m/s up and 1 rad/s, as of the `tum` plant.
    """
    count = int(duration_s / STEP_S)
    heading = rng.uniform(-math.pi, math.pi) if style is Style.STRAFE else rng.normal(0.0, 0.12)
    x, y, z = 0.0, 0.0, 0.0
    v_x, v_y, v_z = 0.0, 0.0, 0.0
    drift = PLANT_NOISE * np.stack([slow_noise(count, 1.0, rng) for _ in range(3)], axis=1)
    level = plan.speed_mps * np.clip(
        1.0
        + rng.normal(0.0, who.drift) * np.linspace(0.0, 1.0, count)
        + who.signal_noise * slow_noise(count, 0.5, rng),
        0.4,
        1.6,
    )
    wander = who.wander_rad * slow_noise(count, 0.8, rng)
    pulses = height_pulses(count, who, rng)
    keep_v = math.exp(-STEP_S / VELOCITY_LAG_S)
    keep_hand = math.exp(-STEP_S / max(who.lag_s, 1e-3))
    every = max(1, round(who.decide_s / STEP_S))
    ahead = max(2, round(who.lookahead_s * plan.speed_mps / PATH_STEP_M))
    late: deque[tuple[float, float, float]] = deque()
    delay = round(who.reaction_s / STEP_S)
    points = plan.points_m
    nearest, last = 0, len(points) - 1
    aim = (0.0, 0.0, 0.0)
    # Where a person aims before seeing any effect: along the path's first metres.
    first = points[min(ahead, last)]
    bearing = math.atan2(first[1], first[0]) - heading
    begun = (math.cos(bearing), math.sin(bearing), 0.0)
    first_stick = begun if style is Style.STRAFE else (1.0, 0.0, 0.0)
    held = [0.0, 0.0, 0.0, 0.0]
    hand = [0.0, 0.0, 0.0, 0.0]
    slow = [0.0, 0.0, 0.0, 0.0]
    out = np.empty((count, 4))
    for i in range(count):
        if i % every == 0:
            while nearest < last and (
                (points[nearest + 1, 0] - x) ** 2 + (points[nearest + 1, 1] - y) ** 2
                < (points[nearest, 0] - x) ** 2 + (points[nearest, 1] - y) ** 2
            ):
                nearest += 1
            target = points[min(nearest + ahead, last)]
            bearing = math.atan2(target[1] - y, target[0] - x) - heading + wander[i]
            bearing = (bearing + math.pi) % (2.0 * math.pi) - math.pi
            up_mps = plan.climb_mps + HEIGHT_GAIN * (plan.climb_mps * i * STEP_S - z)
            up = up_mps / FULL_UP_MPS if abs(up_mps) > 0.04 else 0.0
            if style is Style.STRAFE:
                aim = (math.cos(bearing), math.sin(bearing), up)
            else:
                slower = max(0.25, math.cos(min(abs(bearing), 1.3)))
                aim = (slower, who.gain * bearing / FULL_YAW_RADPS, up)
        late.append(aim)
        seen = late.popleft() if len(late) > delay else first_stick
        ramp = min(1.0, i * STEP_S / who.ramp_s)
        push = float(level[i]) * ramp
        if style is Style.STRAFE:
            wanted = (push * seen[0], push * seen[1], seen[2] + pulses[i], 0.0)
        else:
            turn = max(-1.0, min(1.0, seen[1])) if i >= delay else 0.0
            wanted = (push * seen[0], 0.0, seen[2] + pulses[i], turn)
        for k in range(4):
            if abs(wanted[k] - held[k]) > who.hold or (wanted[k] == 0.0) != (held[k] == 0.0):
                held[k] = wanted[k]
            slow[k] += (1.0 - keep_hand) * (held[k] - slow[k])
            hand[k] += (1.0 - keep_hand) * (slow[k] - hand[k])
        out[i] = hand
        c, s = math.cos(heading), math.sin(heading)
        gain = 1.0 - keep_v
        v_x = keep_v * v_x + gain * (c * hand[0] - s * hand[1] + drift[i, 0])
        v_y = keep_v * v_y + gain * (s * hand[0] + c * hand[1] + drift[i, 1])
        v_z = keep_v * v_z + gain * (FULL_UP_MPS * hand[2] + drift[i, 2])
        x, y, z = x + v_x * STEP_S, y + v_y * STEP_S, z + v_z * STEP_S
        heading += hand[3] * FULL_YAW_RADPS * STEP_S
    if style is Style.STRAFE:
        out[:, 0], out[:, 1] = towards_axes(out[:, 0], out[:, 1], who.axis_pull)
    for axis in np.flatnonzero(np.abs(out).max(axis=0) > 0.05):
        out[:, axis] += tremor(count, who, rng)
    return on_pad(out, who)
