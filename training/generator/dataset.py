"""Sets of labelled sticks by simulated people: the wide population, and the thesis' own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from training.dataset.primitive import Primitive
from training.generator import hands, nothing, observer, pilots
from training.generator.noise import STEP_S, Array
from training.generator.pad import read, worn_offset
from training.generator.people import FAMILIES, THESIS_FAMILIES, Family, People, Style, draw_people
from training.generator.shapes import COMPASS_SHARE, ask
from training.labels import NONE, PRIMITIVES

THESIS_COUNTS = {"line": 597, "arc": 716, "sine": 617, "helix": 469}
"""The thesis' 2399 primitives."""
SHORTEST_S, LONGEST_SAMPLES = 1.0, 400
"""The thesis drops what is shorter than a second or longer than 400 samples."""
CHUNK = 256
TRIES_AT_ONCE = 48
MOST_ROUNDS = 100
NONE_S = (1.2, 8.5)
OPEN_LOOP = {"rest": nothing.rest, "turn": nothing.turn, "free": nothing.free}

IntArray = NDArray[np.int64]
Messages = tuple[Array, Array]


@dataclass(frozen=True)
class Population:
    """Where people are from.

    Attributes:
        name: in the source of their primitives.
        families: kinds of people, in turn.
        difficulty: how far people are from the textbook: scales habits of bad execution and the
            scatter of shapes.
        compass_share: those who set out in one of eight directions.
        yaws: whether anybody touches the yaw axis.
        nothing: how often each kind of nothing is done; together 1.
    """

    name: str
    families: tuple[Family, ...]
    difficulty: float = 1.0
    compass_share: float = COMPASS_SHARE
    yaws: bool = True
    nothing: Mapping[str, float] = field(default_factory=lambda: nothing.KINDS)


THESIS_DIFFICULTY = 2.0
"""Found by `training.generator.calibration`."""
THESIS = Population("thesis", THESIS_FAMILIES, THESIS_DIFFICULTY, compass_share=0.85, yaws=False)
"""The calibrated population: on its sticks the thesis' machine scores as in the thesis."""


def counts_of(multiple: float) -> dict[str, int]:
    """The thesis' counts by label, times `multiple`."""
    return {label: max(1, round(count * multiple)) for label, count in THESIS_COUNTS.items()}


def generate(
    operators: int,
    counts: dict[str, int],
    seed: int,
    families: tuple[Family, ...] = FAMILIES,
    progress: Callable[[int], None] = lambda _: None,
) -> list[Primitive]:
    """A set by `operators` people of the wide population, primitives dealt to them evenly.

    Args:
        operators: how many people.
        counts: performances by label; `none` is one of them.
        seed: the same seed gives the same set.
        families: kinds of people.
        progress: told how many more there are, now and then.

    Raises:
        ValueError: on an unknown label, or without operators or families.
    """
    return populate(Population("wide", families), operators, counts, seed, progress)


def populate(
    population: Population,
    operators: int,
    counts: dict[str, int],
    seed: int,
    progress: Callable[[int], None] = lambda _: None,
) -> list[Primitive]:
    """A set by people of a population; see `generate`."""
    unknown = [label for label in counts if label not in (*PRIMITIVES, NONE)]
    if unknown:
        raise ValueError(f"label {unknown[0]!r} is unknown; use {', '.join((*PRIMITIVES, NONE))}")
    if operators < 1 or not population.families:
        raise ValueError("a set needs at least one operator and one family")
    sequence = np.random.SeedSequence(seed)
    members = [population.families[k % len(population.families)] for k in range(operators)]
    people = draw_people(members, np.random.default_rng(sequence.spawn(1)[0]))
    people = people.worse(population.difficulty)
    styles = np.array([family.style.value for family in members])
    source = f"generator {population.name} seed {seed}"
    made: list[Primitive] = []
    for label, count in counts.items():
        who = np.arange(count) % operators
        messages: list[Messages | None] = [None] * count
        for style in Style:
            places = np.flatnonzero(styles[who] == style.value)
            for begin in range(0, len(places), CHUNK):
                chunk = places[begin : begin + CHUNK]
                rng = np.random.default_rng(sequence.spawn(1)[0])
                performers = people.take(who[chunk])
                done = perform(label, style, performers, population, rng)
                for place, performed in zip(chunk, done, strict=True):
                    messages[place] = performed
                progress(len(chunk))
        for number, one in zip(who, messages, strict=True):
            assert one is not None  # every place is in the chunk of its style
            family = members[number].name
            name = f"{family}-{number:04d}"
            made.append(Primitive(one[0], one[1], label, name, family, source))
    return made


def perform(
    label: str, style: Style, people: People, population: Population, rng: np.random.Generator
) -> list[Messages]:
    """Messages of each of these people for one performance, done again until it is one.

    Raises:
        RuntimeError: if somebody never manages to.
    """
    done: list[Messages | None] = [None] * len(people)
    pending = np.arange(len(people))
    for _ in range(MOST_ROUNDS):
        # Few people waste a loop over time, so the last ones try several times at once.
        again = max(1, TRIES_AT_ONCE // len(pending))
        tries = np.repeat(pending, again)
        messages, good = attempt(label, style, people.take(tries), population, rng)
        for place, one, is_good in zip(tries, messages, good, strict=True):
            if is_good and done[place] is None:
                done[place] = one
        pending = np.array([k for k, one in enumerate(done) if one is None], dtype=np.int64)
        if len(pending) == 0:
            return [one for one in done if one is not None]
    raise RuntimeError(f"{len(pending)} of {len(people)} people cannot fly a {label}")


def attempt(
    label: str, style: Style, people: People, population: Population, rng: np.random.Generator
) -> tuple[list[Messages], NDArray[np.bool_]]:
    """One try of each of these people, and whether an observer and the thesis' filters take it."""
    used = np.array([1.0, 1.0, 1.0, float(population.yaws)])
    offset = worn_offset(people, rng) * used
    if label == NONE:
        sticks, samples, good = _nothing(people, offset, population.nothing, rng)
        sticks *= used
    else:
        shapes = ask(label, people, style, rng, population.difficulty, population.compass_share)
        if style is Style.HAND:
            sticks, samples = hands.draw(shapes, people, rng)
            sticks *= used
            where_m = _flown_m(sticks, offset, people)
        else:
            sticks, samples, where_m = pilots.fly(shapes, people, offset, rng)
        path_m = observer.seen(where_m, samples)
        good = observer.looks_like(label, path_m, shapes.vertical, shapes.plane_rad)
    messages = read(sticks, samples, offset, people, rng, begun=label != NONE)
    fits = [t[-1] >= SHORTEST_S and len(t) <= LONGEST_SAMPLES for t, _ in messages]
    return messages, good & np.array(fits)


def _flown_m(sticks: Array, offset: Array, people: People) -> Array:
    """Where (n, k, 3) sticks (n, k, 4) take a vehicle that nobody watches."""
    return observer.flown_m(hands.alive(sticks + offset[:, None], people.dead_band[:, None, None]))


def _nothing(
    people: People, offset: Array, shares: Mapping[str, float], rng: np.random.Generator
) -> tuple[Array, IntArray, NDArray[np.bool_]]:
    """Sticks without a primitive in them, samples of each, and whether an observer agrees."""
    n = len(people)
    duration_s = np.clip(3.6 * np.exp(0.5 * rng.standard_normal(n)), *NONE_S)
    samples = np.round(duration_s / STEP_S).astype(np.int64)
    count = int(samples.max())
    sticks = np.zeros((n, count, 4))
    names = list(shares)
    kinds = rng.choice(len(names), n, p=list(shares.values()))
    for kind, name in enumerate(names):
        rows = np.flatnonzero(kinds == kind)
        if len(rows) == 0:
            continue
        actors = people.take(rows)
        if name == "hover":
            sticks[rows] = nothing.hover(actors, count, offset[rows], rng)
        else:
            sticks[rows] = OPEN_LOOP[name](actors, count, rng)
    good = np.ones(n, dtype=bool)
    free = np.flatnonzero(np.array(names)[kinds] == "free")
    if len(free):
        where_m = _flown_m(sticks[free], offset[free], people.take(free))
        path_m = observer.seen(where_m, samples[free])
        ends_m = path_m[:, -1] - path_m[:, 0]
        ahead_rad = np.arctan2(ends_m[:, 1], ends_m[:, 0])
        for label in PRIMITIVES:
            for vertical in (False, True):
                plane = np.full(len(free), vertical)
                good[free] &= ~observer.looks_like(label, path_m, plane, ahead_rad)
    return sticks, samples, good


def holds(
    operators: int, seconds: float, seed: int, families: Sequence[Family] = FAMILIES
) -> list[tuple[Primitive, Array]]:
    """Hover corrections without a pause, and where the vehicle was.

    Args:
        operators: how many people.
        seconds: how long each holds the place.
        seed: the same seed gives the same.
        families: kinds of people, in turn.

    Returns:
        Of each person the sticks, and x y z in m and yaw in rad (N, 4) every `STEP_S`.
    """
    members = [families[k % len(families)] for k in range(operators)]
    rng = np.random.default_rng(seed)
    people = draw_people(members, rng)
    count = round(seconds / STEP_S) + 1
    offset = worn_offset(people, rng)
    sticks, places = nothing.held_place(people, count, offset, rng)
    messages = read(sticks, np.full(operators, count), offset, people, rng, begun=False)
    source = f"generator hover seed {seed}"
    return [
        (Primitive(times_s, read_, NONE, f"{family.name}-{number:04d}", family.name, source), place)
        for number, (family, (times_s, read_), place) in enumerate(
            zip(members, messages, places, strict=True)
        )
    ]
