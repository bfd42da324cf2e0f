"""What people do when they mean no primitive: rest, turn on the spot, hold a place, fly about."""

import math

import numpy as np
from numpy.typing import NDArray

from training.generator.hands import (
    FULL_UP_MPS,
    FULL_YAW_RADPS,
    alive,
    finished,
    shaken,
    stepped,
    taps,
    towards_axes,
)
from training.generator.noise import STEP_S, Array, pulses, slow, wander
from training.generator.people import People

IntArray = NDArray[np.int64]

KINDS = {"rest": 0.15, "turn": 0.2, "hover": 0.3, "free": 0.35}
"""How often each is done (chosen)."""
GUST_MPS = (0.03, 0.3)
"""Speed that the air gives a vehicle that somebody holds in place."""
HOLD_SEEN_M = (0.08, 0.35)
"""A vehicle nearer to its place is let be."""
HOLD_GAIN = (0.7, 1.8)
"""Push per error, 1/m."""
INTENTION_S = (0.3, 1.3)
"""Free flight: each intention lasts this long, then there is another one."""


def rest(people: People, count: int, rng: np.random.Generator) -> Array:
    """Sticks (n, count, 4) of thumbs that lie on them: tremor, and a lean that comes and goes."""
    n = len(people)
    lean = rng.exponential(0.02, (n, 1, 4)) * (rng.random((n, 1, 4)) < 0.6)
    drift = np.stack([slow(n, count, 1.0, rng) for _ in range(4)], axis=2)
    rested = np.clip(lean * (1.0 + 0.5 * drift), -0.12, 0.12) * rng.choice((-1.0, 1.0), (n, 1, 4))
    return shaken(rested, people, rng)


def turn(people: People, count: int, rng: np.random.Generator) -> Array:
    """Sticks (n, count, 4) of people who look around: the vehicle turns and goes nowhere."""
    n = len(people)
    level = people.push * np.exp(0.3 * rng.standard_normal(n))
    one_way = np.ones((n, count)) * rng.choice((-1.0, 1.0), (n, 1))
    to_and_fro = np.sign(wander(n, count, rng))
    gaze = pulses(np.full(n, 0.9), count, (0.3, 1.6), 0.8, rng)
    kind = rng.integers(0, 3, (n, 1))
    yaw = np.select([kind == 0, kind == 1], [one_way, to_and_fro], gaze) * level[:, None]
    nudges = pulses(people.height_hz * 0.5, count, (0.1, 0.4), 0.15, rng)
    leak = people.cross_talk[:, None] * yaw * slow(n, count, 0.5, rng)
    ramp = np.clip(np.arange(count) * STEP_S / people.ramp_s[:, None], 0.0, 1.0)
    wanted = np.stack([leak, leak * rng.normal(0.0, 1.0, (n, 1)), nudges, yaw * ramp], axis=2)
    wanted *= taps(people, count, rng)[:, :, None]
    return finished(wanted, people, rng)


def free(people: People, count: int, rng: np.random.Generator) -> Array:
    """Sticks (n, count, 4) of people who fly about: another intention every second or so."""
    n = len(people)
    rows = np.arange(n)[:, None]
    most = int(count * STEP_S / INTENTION_S[0]) + 2
    ends = np.cumsum(rng.uniform(*INTENTION_S, (n, most)), axis=1)
    time_s = np.arange(count) * STEP_S
    which = np.stack([np.searchsorted(end, time_s) for end in ends])
    level = people.push[:, None] * rng.uniform(0.3, 1.2, (n, most))
    level *= rng.random((n, most)) > 0.2
    angle = rng.uniform(-math.pi, math.pi, (n, most))
    level, angle = level[rows, which], angle[rows, which]
    jerky_x, jerky_y = level * np.cos(angle), level * np.sin(angle)
    smooth = rng.random((n, 1)) < 0.5
    push = people.push[:, None]
    vx = np.where(smooth, 0.8 * push * slow(n, count, 0.35, rng), jerky_x)
    vy = np.where(smooth, 0.8 * push * slow(n, count, 0.35, rng), jerky_y)
    vx, vy = towards_axes(vx, vy, people.axis_pull[:, None])
    vx, vy = stepped(vx, vy, people.steps[:, None])
    climbs = rng.random((n, 1)) < 0.5
    up = np.where(climbs, pulses(np.full(n, 0.6), count, (0.3, 1.5), 0.5, rng), 0.0)
    turns = (rng.random(n) < 0.3 + 0.6 * people.yaw)[:, None]
    yaw = np.where(turns, pulses(np.full(n, 0.8), count, (0.3, 1.5), 0.6, rng), 0.0)
    wanted = np.stack([vx, vy, up, yaw], axis=2) * taps(people, count, rng)[:, :, None]
    return finished(wanted, people, rng)


def hover(people: People, count: int, offset: Array, rng: np.random.Generator) -> Array:
    """Sticks (n, count, 4) of people who hold a vehicle in its place in wind."""
    return held_place(people, count, offset, rng)[0]


def held_place(
    people: People, count: int, offset: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """The sticks of `hover`, and where the vehicle was.

    People push back what has moved away by more than they mind, and take the speed out of it again.

    Returns:
        Sticks (n, count, 4), and x y z in m and yaw in rad (n, count, 4).
    """
    n = len(people)
    gust = rng.uniform(*GUST_MPS, (n, 1, 1))
    mean = 0.3 * gust * rng.standard_normal((n, 1, 3))
    air = mean + gust * np.stack([slow(n, count, 1.2, rng) for _ in range(3)], axis=2)
    minded_m = rng.uniform(*HOLD_SEEN_M, (n, 1))
    gain = rng.uniform(*HOLD_GAIN, (n, 1))
    damping_s = rng.uniform(0.3, 1.0, (n, 1))
    full = np.array([1.0, 1.0, FULL_UP_MPS])
    minds_yaw = (rng.random(n) < 0.2 + 0.6 * people.yaw)[:, None]
    twist = 0.15 * slow(n, count, 1.5, rng)
    keep_vehicle = np.exp(-STEP_S / people.vehicle_s)[:, None]
    keep_hand = np.exp(-STEP_S / people.lag_s)[:, None]
    delay = np.round(people.reaction_s / STEP_S).astype(np.int64)
    decide = np.maximum(1, np.round(people.decide_s / STEP_S)).astype(np.int64)[:, None]
    gate = taps(people, count, rng)
    noise = 1.0 + 2.0 * people.signal_noise[:, None] * slow(n, count, 0.12, rng)
    # When the recording begins, the vehicle already is somewhere else, and moves.
    where = 0.2 * rng.standard_normal((n, 3))
    speed = 0.1 * rng.standard_normal((n, 3))
    heading = 0.2 * rng.standard_normal(n)
    aims = np.zeros((count, n, 4))
    aim, first, hand, still = (np.zeros((n, 4)) for _ in range(4))
    acts = np.zeros((n, 3), dtype=bool)
    rows = np.arange(n)
    out, places = np.empty((n, count, 4)), np.empty((n, count, 4))
    for i in range(count):
        places[:, i] = np.column_stack([where, heading])
        drifted = where + damping_s * speed
        # Once at it, people go on until the error is well below what they mind.
        acts = np.abs(drifted) > np.where(acts, 0.4, 1.0) * minded_m
        answer = np.where(acts, -gain * drifted, 0.0)
        cos, sin = np.cos(heading), np.sin(heading)
        now = np.stack(
            [
                cos * answer[:, 0] + sin * answer[:, 1],
                cos * answer[:, 1] - sin * answer[:, 0],
                answer[:, 2] / FULL_UP_MPS,
                np.where(minds_yaw[:, 0] & (np.abs(heading) > 0.15), -heading, 0.0),
            ],
            axis=1,
        )
        aim = np.where(i % decide == 0, now, aim)
        aims[i] = aim
        wanted = aims[np.maximum(i - delay, 0), rows].copy()
        wanted[:, 0], wanted[:, 1] = stepped(
            *towards_axes(wanted[:, 0], wanted[:, 1], people.axis_pull), people.steps
        )
        wanted[:, :3] *= gate[:, i, None] * noise[:, i, None]
        still = np.where(
            (np.abs(wanted - still) > people.hold[:, None]) | (wanted == 0), wanted, still
        )
        first = keep_hand * first + (1.0 - keep_hand) * still
        hand = keep_hand * hand + (1.0 - keep_hand) * first
        stick = np.clip(hand, -1.0, 1.0)
        out[:, i] = stick
        stick = alive(stick + offset, people.dead_band[:, None])
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
        heading = heading + (stick[:, 3] * FULL_YAW_RADPS + twist[:, i]) * STEP_S
    return shaken(out, people, rng), places
