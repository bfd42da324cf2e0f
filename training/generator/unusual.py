"""Unusual people: ordinary ones with odd ways, which nobody in training has.

A way is odd but steady: it is the same in each of a person's performances, so a few of them show
it. (Noise is not: who only does everything worse shows nothing that could be learned.) Who is
unusual is an ordinary person of a family with `WAYS_EACH` of the ways below, at random, each with a
strength and a side of its own. No observer asks for another try: what a person does by a name keeps
it, however it looks. docs/people.md is the table to read.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from training.dataset.primitive import Primitive
from training.generator import hands, pilots
from training.generator.dataset import LONGEST_SAMPLES, MOST_ROUNDS, SHORTEST_S
from training.generator.noise import STEP_S, Array
from training.generator.pad import read, worn_offset
from training.generator.people import FAMILIES, Family, People, Style, draw_people
from training.generator.shapes import Shapes, ask
from training.labels import PRIMITIVES

WAYS: dict[str, tuple[float, float]] = {
    "leaning": (0.6, 1.2),
    "shallow": (math.radians(35.0), math.radians(60.0)),
    "flat": (0.2, 0.4),
    "half": (0.5, 0.75),
    "lead-in": (0.3, 0.5),
    "oval": (0.7, 1.1),
    "rising": (0.15, 0.35),
    "stairs": (0.3, 0.5),
    "low": (0.1, 0.25),
    "braking": (0.5, 0.9),
    "rushed": (0.4, 0.6),
    "slow": (1.7, 2.3),
    "axes": (0.85, 1.0),
}
"""Ranges of strengths, all chosen, beyond what anybody in training has:

leaning: bend of every shape to one side, rad. shallow: turn of arcs and helices, rad. flat:
steepest slope of sines. half: periods of sines. lead-in: straight share before every curve. oval:
log ratio of the two axes of every shape. rising: push up or down by every push along, as a share of
it. stairs: share of a helix, its beginning or its end, in which it climbs at all. low: climb of
helices. braking: push against the motion at the end, as a share of the last push. rushed, slow: of
the usual time. axes: `People.axis_pull`.
"""
WAYS_EACH = 3
OPPOSITE = {"rushed": "slow", "slow": "rushed"}
STRENGTH_DEVIATION = 0.1
"""Of the logarithm, from one performance to the next."""
BRAKE_S = (0.25, 0.5)
LAST_S = 0.4
"""What is braked against is the mean push of so long before the end."""
TIME_S = (1.2, 6.8)
"""Shortest and longest that anybody means to take: less than 1 s or more than 400 samples is
dropped."""


@dataclass(frozen=True)
class _Odd(Shapes):
    """Shapes with odd ways that ordinary ones have no number for; each field (n,).

    Attributes:
        oval: log ratio of the speeds along and across, of everything.
        rising: push upwards that goes with each push along.
        stairs: share of the performance with all of the climb: > 0 its beginning, < 0 its end.
    """

    oval: Array
    rising: Array
    stairs: Array

    def direction(self, progress: Array) -> Array:
        """Of the shape, stretched."""
        meant = super().direction(progress)
        along, across = self._stretched(meant)
        turn = np.arctan2(across, along) - meant
        return meant + (turn + math.pi) % (2.0 * math.pi) - math.pi

    def speed(self, progress: Array) -> Array:
        """Of the shape, stretched; the largest push is no larger."""
        along, across = self._stretched(super().direction(progress))
        size = np.exp(-0.5 * np.abs(self.oval))[:, None]
        return super().speed(progress) * np.hypot(along, across) * size

    def climbing(self, progress: Array) -> Array:
        """Of a helix in two parts, the whole climb in one of them."""
        share = np.maximum(np.abs(self.stairs), 1e-6)[:, None]
        place = np.where(self.stairs[:, None] > 0.0, progress, 1.0 - progress)
        part = np.where((place >= 0.0) & (place < share), 1.0 / share, 0.0)
        part = np.where(self.stairs[:, None] == 0.0, 1.0, part)
        return self.climb[:, None] * part + self.rising[:, None]

    def _stretched(self, direction: Array) -> tuple[Array, Array]:
        stretch = np.exp(0.5 * self.oval)[:, None]
        return np.cos(direction) * stretch, np.sin(direction) / stretch


@dataclass(frozen=True)
class Ways:
    """Odd ways of n people: strengths (n, len(WAYS)), 0 where a person has none; sides alike."""

    strengths: Array
    sides: Array

    def take(self, index: NDArray[np.int64]) -> "Ways":
        """Those of the people at these places, some of them more than once."""
        return Ways(self.strengths[index], self.sides[index])

    def of(self, name: str, rng: np.random.Generator) -> Array:
        """One way's strengths (n,) in one performance of each."""
        strength = self.strengths[:, list(WAYS).index(name)]
        return strength * np.exp(STRENGTH_DEVIATION * rng.standard_normal(len(strength)))

    def side(self, name: str) -> Array:
        """One way's sides (n,): -1 or 1."""
        return self.sides[:, list(WAYS).index(name)]


def draw_ways(n: int, rng: np.random.Generator) -> Ways:
    """Odd ways of n people: three each, strengths uniform in their ranges, sides by a coin."""
    names = list(WAYS)
    strengths = np.zeros((n, len(names)))
    for row in range(n):
        chosen: list[str] = []
        for name in rng.permutation(names):
            if len(chosen) < WAYS_EACH and OPPOSITE.get(name) not in chosen:
                chosen.append(str(name))
        for name in chosen:
            strengths[row, names.index(name)] = rng.uniform(*WAYS[name])
    return Ways(strengths, rng.choice((-1.0, 1.0), (n, len(names))))


def unusual(
    operators: int, each: int, seed: int, families: tuple[Family, ...] = FAMILIES
) -> list[Primitive]:
    """Performances of the four primitives by unusual people, `each` of each.

    Args:
        operators: how many people.
        each: performances of each primitive and person.
        seed: the same seed gives the same people.
        families: kinds of people that they would be without their odd ways, in turn.

    Raises:
        RuntimeError: if somebody's performances are always too long or too short.
    """
    rng = np.random.default_rng(np.random.SeedSequence((seed, 11)))
    members = [families[k % len(families)] for k in range(operators)]
    people, ways = draw_people(members, rng), draw_ways(operators, rng)
    styles = np.array([family.style for family in members])
    done: dict[tuple[int, str], list[tuple[Array, Array]]] = {}
    for label in PRIMITIVES:
        for style in Style:
            pending = np.flatnonzero(styles == style)
            for _ in range(MOST_ROUNDS):
                who = pending.repeat(each)
                if len(who) == 0:
                    break
                messages = _tried(label, style, people.take(who), ways.take(who), rng)
                for number, (times_s, sticks) in zip(who.tolist(), messages, strict=True):
                    if times_s[-1] >= SHORTEST_S and len(times_s) <= LONGEST_SAMPLES:
                        done.setdefault((number, label), []).append((times_s, sticks))
                pending = np.array(
                    [k for k in pending.tolist() if len(done.get((k, label), [])) < each],
                    dtype=np.int64,
                )
            else:
                raise RuntimeError(f"{len(pending)} people cannot perform a {label} in time")
    source = f"generator unusual seed {seed}"
    return [
        Primitive(times_s, sticks, label, f"unusual-{number:04d}", members[number].name, source)
        for (number, label), performed in done.items()
        for times_s, sticks in performed[:each]
    ]


def _tried(
    label: str, style: Style, people: People, ways: Ways, rng: np.random.Generator
) -> list[tuple[Array, Array]]:
    """Messages of one performance of each."""
    offset = worn_offset(people, rng)
    axes = ways.of("axes", rng)
    people = replace(
        people, axis_pull=np.where(axes > 0.0, np.minimum(axes, 1.0), people.axis_pull)
    )
    shapes = _odd(label, ask(label, people, style, rng), ways, rng)
    if style is Style.HAND:
        sticks, samples = hands.draw(shapes, people, rng)
    else:
        sticks, samples, _ = pilots.fly(shapes, people, offset, rng)
    sticks, samples = _braked(sticks, samples, ways.of("braking", rng), people, rng)
    return read(sticks, samples, offset, people, rng, begun=True)


def _odd(label: str, shapes: Shapes, ways: Ways, rng: np.random.Generator) -> _Odd:
    """Shapes as people with odd ways make them."""

    def instead(name: str, usual: Array, odd: Array | None = None) -> Array:
        strength = ways.of(name, rng)
        return np.where(strength > 0.0, strength if odd is None else odd, usual)

    zeros = np.zeros(len(shapes.duration_s))
    changed = {field.name: getattr(shapes, field.name) for field in fields(Shapes)}
    time = instead("rushed", zeros + 1.0) * instead("slow", zeros + 1.0)
    leaning = ways.of("leaning", rng)
    changed["bend_rad"] = shapes.bend_rad + leaning * ways.side("leaning")
    if label != "line":
        changed["straight"] = instead("lead-in", shapes.straight)
    if label in ("arc", "helix"):
        turn = instead("shallow", np.abs(shapes.sweep_rad))
        changed["sweep_rad"] = np.sign(shapes.sweep_rad) * turn
    if label == "sine":
        changed["slope"] = instead("flat", shapes.slope)
        cycles = instead("half", shapes.cycles)
        # A period takes as long as it did.
        time = time * cycles / shapes.cycles
        changed["cycles"] = cycles
    stairs = zeros
    if label == "helix":
        changed["climb"] = np.sign(shapes.climb) * instead("low", np.abs(shapes.climb))
        stairs = ways.of("stairs", rng) * ways.side("stairs")
    changed["duration_s"] = np.clip(shapes.duration_s * time, *TIME_S)
    return _Odd(
        **changed,
        oval=ways.of("oval", rng) * ways.side("oval"),
        rising=ways.of("rising", rng) * ways.side("rising"),
        stairs=stairs,
    )


def _braked(
    sticks: Array,
    samples: NDArray[np.int64],
    strength: Array,
    people: People,
    rng: np.random.Generator,
) -> tuple[Array, NDArray[np.int64]]:
    """Sticks (n, k, 4) of whom brakes with a push against the motion after their last sample."""
    n = len(sticks)
    brake = np.where(strength > 0.0, np.round(rng.uniform(*BRAKE_S, n) / STEP_S), 0.0)
    brake = brake.astype(np.int64)
    total = samples + brake
    out = np.zeros((n, max(int(total.max()), sticks.shape[1]), 4))
    out[:, : sticks.shape[1]] = sticks
    last = round(LAST_S / STEP_S)
    for row in np.flatnonzero(brake):
        end = samples[row]
        # Letting go may be a part of it already, so the largest push of the last ones counts.
        before = sticks[row, max(0, end - 2 * last) : end, :3]
        pushed = before[: max(1, len(before) - last // 2)][-last:].mean(axis=0)
        after = np.arange(1, brake[row] + 1) * STEP_S
        answer = 1.0 - np.exp(-after / (2.0 * people.lag_s[row]))
        held = sticks[row, end - 1, :3]
        against = -strength[row] * pushed
        out[row, end : total[row], :3] = held + (against - held) * answer[:, None]
    return out, total
