"""Sets of labelled sticks: operators of many families, each performing all four primitives."""

from collections.abc import Callable

import numpy as np

from training.dataset.primitive import Primitive
from training.generator.hands import STEP_S, hand
from training.generator.operators import FAMILIES, Family, Operator, Style, draw_operator
from training.generator.pilots import pilot
from training.generator.shapes import Array, hand_plan, path_plan

THESIS_COUNTS = {"line": 597, "arc": 716, "sine": 617, "helix": 469}
"""The thesis' 2399 primitives."""
PILOT_DURATIONS_S = {"line": (1.5, 7.0), "arc": (2.0, 8.0), "sine": (4.0, 8.5), "helix": (2.5, 8.5)}
SHORTEST_S, LONGEST_SAMPLES = 1.0, 400
"""The thesis drops what is shorter than a second or longer than 400 samples."""


def counts_of(multiple: float) -> dict[str, int]:
    """The thesis' counts by label, times `multiple`."""
    return {label: max(1, round(count * multiple)) for label, count in THESIS_COUNTS.items()}


def perform(
    label: str, family: Family, who: Operator, name: str, source: str, rng: np.random.Generator
) -> Primitive:
    """One primitive by one person, sampled as a pad is: irregular times, lost samples."""
    while True:
        if family.style is Style.HAND:
            sticks = hand(hand_plan(label, rng, STEP_S), who, rng)
        else:
            duration_s = float(rng.uniform(*PILOT_DURATIONS_S[label]))
            sticks = pilot(path_plan(label, rng), who, family.style, duration_s, rng)
        times_s, sticks = _sampled(sticks, who, rng)
        if times_s[-1] >= SHORTEST_S and len(times_s) <= LONGEST_SAMPLES:
            return Primitive(times_s, sticks, label, name, family.name, source)


def _sampled(sticks: Array, who: Operator, rng: np.random.Generator) -> tuple[Array, Array]:
    """Sticks at `STEP_S` read at a pad's own irregular times."""
    # Before the first deflection nothing is being performed.
    moving = np.flatnonzero(np.abs(sticks).max(axis=1) > 0.05)
    sticks = sticks[moving[0] if len(moving) else 0 :]
    duration_s = (len(sticks) - 1) * STEP_S
    count = int(duration_s * who.rate_hz) + 2
    steps = np.clip(1.0 + who.jitter * rng.standard_normal(count), 0.3, 2.5) / who.rate_hz
    times_s = np.concatenate([[0.0], np.cumsum(steps)])
    times_s = times_s[times_s <= duration_s]
    kept = rng.random(len(times_s)) >= who.loss
    kept[0] = True
    times_s = times_s[kept]
    grid_s = np.arange(len(sticks)) * STEP_S
    read = np.stack([np.interp(times_s, grid_s, sticks[:, k]) for k in range(4)], axis=1)
    return times_s, read


def generate(
    operators: int,
    counts: dict[str, int],
    seed: int,
    families: tuple[Family, ...] = FAMILIES,
    progress: Callable[[int], None] = lambda _: None,
) -> list[Primitive]:
    """A set by `operators` people, families in turn, primitives dealt to them evenly.

    Args:
        operators: how many people.
        counts: primitives by label.
        seed: the same seed gives the same set.
        families: kinds of people.
        progress: told how many more primitives there are, now and then.
    """
    sequence = np.random.SeedSequence(seed)
    people = []
    for number, child in enumerate(sequence.spawn(operators)):
        family = families[number % len(families)]
        people.append((family, draw_operator(family, np.random.default_rng(child))))
    primitives: list[Primitive] = []
    streams = sequence.spawn(sum(counts.values()))
    for label, count in counts.items():
        for turn in range(count):
            number = turn % operators
            family, who = people[number]
            rng = np.random.default_rng(streams[len(primitives)])
            name = f"{family.name}-{number:04d}"
            primitives.append(perform(label, family, who, name, f"generator wide seed {seed}", rng))
            if turn % 20 == 19:
                progress(20)
    return primitives
