"""Pilots, who watch a moving vehicle and steer it along a path, by yaw, by strafing, or by both.

One loop over time steps many performances at once (rows).
"""

import math

import numpy as np
from numpy.typing import NDArray

from training.generator.hands import (
    FULL_UP_MPS,
    FULL_YAW_RADPS,
    alive,
    shaken,
    stepped,
    taps,
    towards_axes,
)
from training.generator.noise import STEP_S, Array, pulses, slow, wander
from training.generator.people import People
from training.generator.shapes import Shapes

POINTS = 240
BEYOND = 1.35
"""A path goes on in a pilot's mind: progress up to which it is known."""
SLOWEST_TURN = 0.25
"""Share of the push that remains while the nose points elsewhere."""
HEIGHT_GAIN = 0.8
"""Speed per error in height, 1/s (chosen)."""
HEIGHT_SEEN_M = 0.06
"""Smaller errors in height are let be."""
LONGEST_S = 8.6
PRESS_S = (0.0, 0.35)
"""From the end of the path to the stop button."""


def path_m(shapes: Shapes, people: People, push: Array) -> Array:
    """Points (n, POINTS, 3) of the path meant, from the origin."""
    progress = np.linspace(0.0, BEYOND, POINTS)[None].repeat(len(people), axis=0)
    direction = shapes.direction(progress)
    step_m = (push * shapes.duration_s * BEYOND / (POINTS - 1))[:, None] * shapes.speed(progress)
    along, across = step_m * np.cos(direction), step_m * np.sin(direction)
    plane = shapes.plane_rad[:, None]
    # Straight up and down a vehicle is slower; the shape is drawn as large as it can fly.
    across = np.where(shapes.vertical[:, None], across * FULL_UP_MPS, across)
    x = np.where(shapes.vertical[:, None], along * np.cos(plane), along)
    y = np.where(shapes.vertical[:, None], along * np.sin(plane), across)
    z = np.where(shapes.vertical[:, None], across, FULL_UP_MPS * shapes.climbing(progress) * step_m)
    steps = np.stack([x, y, z], axis=2)
    return np.asarray(np.cumsum(steps, axis=1) - steps[:, :1])


def fly(
    shapes: Shapes, people: People, offset: Array, rng: np.random.Generator
) -> tuple[Array, NDArray[np.int64], Array]:
    """Sticks of pilots who steer the tum plant along shapes and correct what they see.

    Args:
        shapes: what each is asked for.
        people: who.
        offset: (n, 4) of their worn pads.
        rng: source of it all.

    Returns:
        (n, k, 4) at `STEP_S`, how many of the k samples belong to each performance, and where
        (n, k, 3) the vehicle was, in m.
    """
    n, count = len(people), int(LONGEST_S / STEP_S)
    rows = np.arange(n)
    push = np.clip(people.push * np.exp(0.2 * rng.standard_normal(n)), 0.15, 1.1)
    points = path_m(shapes, people, push)
    end = int(np.searchsorted(np.linspace(0.0, BEYOND, POINTS), 1.0))
    spacing = np.linalg.norm(np.diff(points, axis=1), axis=2).mean(axis=1)
    ahead = np.clip(
        np.round(people.lookahead_s * push / np.maximum(spacing, 1e-3)), 2, POINTS // 3
    ).astype(np.int64)

    # The path is drawn in the frame of the vehicle's first heading.
    heading = np.where(people.yaw > 0.5, 0.12 * rng.standard_normal(n), 0.0)
    tail_first = np.where((people.yaw > 0.5) & (np.cos(shapes.plane_rad) < -0.5), -1.0, 1.0)
    fade = 1.0 + people.drift[:, None] * rng.standard_normal((n, 1)) * np.linspace(0, 1, count)
    level = push[:, None] * np.clip(
        fade * (1.0 + 0.5 * people.warp[:, None] * wander(n, count, rng)), 0.3, 1.6
    )
    stops = pulses(people.hesitation_hz, count, (0.1, 0.5), 1.0, rng)
    level = np.where(stops != 0.0, 0.2, level) * np.clip(
        np.arange(count) * STEP_S / people.ramp_s[:, None], 0.0, 1.0
    )
    astray = people.wander_rad[:, None] * wander(n, count, rng)
    astray += pulses(people.correction_hz, count, (0.1, 0.35), 0.3, rng)
    height = pulses(people.height_hz, count, (0.15, 0.7), 0.25, rng)
    # Who taps pushes harder, to get on.
    gate = taps(people, count, rng) / (1.0 - 0.7 * people.tap[:, None])
    air = people.wind_mps[:, None, None] * np.stack([slow(n, count, 1.0, rng) for _ in range(3)], 2)
    noise = 1.0 + people.signal_noise[:, None, None] * np.stack(
        [slow(n, count, 0.12, rng) for _ in range(4)], 2
    )

    keep_vehicle = np.exp(-STEP_S / people.vehicle_s)[:, None]
    keep_hand = np.exp(-STEP_S / people.lag_s)[:, None]
    delay = np.round(people.reaction_s / STEP_S).astype(np.int64)
    decide = np.maximum(1, np.round(people.decide_s / STEP_S)).astype(np.int64)
    look = np.maximum(1, np.round(people.look_s / STEP_S)).astype(np.int64)
    ratio = np.exp(0.5 * people.imbalance * rng.standard_normal(n))
    hold, dead_band = people.hold[:, None], people.dead_band[:, None]
    full = np.array([1.0, 1.0, FULL_UP_MPS])

    where = np.zeros((n, 3))
    speed = np.zeros((n, 3))
    nearest = np.zeros(n, dtype=np.int64)
    finished = np.full(n, count, dtype=np.int64)
    aims = np.zeros((count, n, 3))  # bearing in rad, horizontal share, up in fractions
    aim = np.zeros((n, 3))
    held = np.zeros((n, 4))
    first = np.zeros((n, 4))
    hand = np.zeros((n, 4))
    out = np.empty((n, count, 4))
    flown_m = np.empty((n, count, 3))
    wanted = np.empty((n, 4))
    for i in range(count):
        for _ in range(2):
            here = points[rows, nearest] - where
            beyond = points[rows, np.minimum(nearest + 1, POINTS - 1)] - where
            nearer = (beyond**2).sum(axis=1) < (here**2).sum(axis=1)
            nearest = np.minimum(nearest + nearer, POINTS - 1)
        finished = np.where((nearest >= end) & (finished == count), i, finished)
        if (finished < i - 25).all():
            out, flown_m = out[:, :i], flown_m[:, :i]
            break
        target = points[rows, np.minimum(nearest + ahead, POINTS - 1)] - where
        level_m = np.hypot(target[:, 0], target[:, 1])
        distance_m = np.maximum(np.hypot(level_m, target[:, 2]), 1e-6)
        bearing = np.arctan2(target[:, 1], target[:, 0]) - heading + astray[:, i]
        bearing = np.where(tail_first < 0.0, bearing + math.pi, bearing)
        bearing = (bearing + math.pi) % (2.0 * math.pi) - math.pi
        meant = points[rows, np.minimum(nearest + 1, POINTS - 1)] - points[rows, nearest]
        along = np.maximum(np.linalg.norm(meant, axis=1), 1e-6)
        error_m = points[rows, nearest, 2] - where[:, 2]
        error_m = np.where(np.abs(error_m) > HEIGHT_SEEN_M, error_m, 0.0)
        up = (push * meant[:, 2] / along + HEIGHT_GAIN * error_m) / FULL_UP_MPS
        decides = i % decide == 0
        aim[:, 0] = np.where(decides, bearing, aim[:, 0])
        aim[:, 1] = np.where(decides, level_m / distance_m, aim[:, 1])
        aim[:, 2] = np.where((i % look == 0) | (shapes.vertical & decides), up, aim[:, 2])
        aims[i] = aim
        seen = aims[np.maximum(i - delay, 0), rows]

        cos, sin = np.cos(seen[:, 0]), np.sin(seen[:, 0])
        ahead_share = people.strafe * cos + (1.0 - people.strafe) * np.maximum(cos, SLOWEST_TURN)
        pushed = level[:, i] * seen[:, 1]
        vx = tail_first * pushed * ahead_share * ratio
        vy = pushed * people.strafe * sin * tail_first / ratio
        vx, vy = towards_axes(vx, vy, people.axis_pull)
        vx, vy = stepped(vx, vy, people.steps)
        wanted[:, 0], wanted[:, 1] = vx * gate[:, i], vy * gate[:, i]
        wanted[:, 2] = seen[:, 2] + height[:, i] + people.cross_talk * vx * 0.5
        turn = np.clip(people.yaw * people.gain * seen[:, 0] / FULL_YAW_RADPS, -1.0, 1.0)
        wanted[:, 3] = np.where(i >= delay, turn, 0.0)
        moves = (np.abs(wanted - held) > hold) | (wanted == 0.0)
        held = np.where(moves, wanted, held)
        first = keep_hand * first + (1.0 - keep_hand) * held
        hand = keep_hand * hand + (1.0 - keep_hand) * first
        stick = np.clip(hand * noise[:, i], -1.0, 1.0)
        out[:, i] = stick
        stick = alive(stick + offset, dead_band)
        cos, sin = np.cos(heading), np.sin(heading)
        world = np.stack(
            [
                cos * stick[:, 0] - sin * stick[:, 1],
                sin * stick[:, 0] + cos * stick[:, 1],
                stick[:, 2],
            ],
            axis=1,
        )
        speed = keep_vehicle * speed + (1.0 - keep_vehicle) * (world * full + air[:, i])
        where = where + speed * STEP_S
        flown_m[:, i] = where
        heading = heading + stick[:, 3] * FULL_YAW_RADPS * STEP_S
    pressed = np.round(rng.uniform(*PRESS_S, n) / STEP_S).astype(np.int64)
    samples = np.clip(finished + pressed, 2, out.shape[1])
    return shaken(out, people, rng), samples, flown_m
