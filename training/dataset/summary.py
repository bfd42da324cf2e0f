"""A data set in numbers: counts, lengths, rates. Pure."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from training.dataset.primitive import Primitive
from training.labels import CLASSES


@dataclass(frozen=True)
class Group:
    """Primitives that share something.

    Attributes:
        name: what they share.
        counts: primitives by class.
        operators: how many people.
        samples: least, median and most samples of one.
        seconds: shortest, median and longest.
        rates_hz: lowest, median and highest.
    """

    name: str
    counts: dict[str, int]
    operators: int
    samples: tuple[int, float, int]
    seconds: tuple[float, float, float]
    rates_hz: tuple[float, float, float]

    @property
    def count(self) -> int:
        """How many primitives there are."""
        return sum(self.counts.values())


def group_of(name: str, primitives: Sequence[Primitive]) -> Group:
    """The numbers of some primitives, at least one."""
    labels = [p.label for p in primitives]
    least, median, most = _spread([len(p) for p in primitives])
    return Group(
        name,
        {label: labels.count(label) for label in CLASSES},
        len({p.operator for p in primitives}),
        (int(least), median, int(most)),
        _spread([p.duration_s for p in primitives]),
        _spread([p.rate_hz for p in primitives]),
    )


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    return float(np.min(values)), float(np.median(values)), float(np.max(values))


def grouped(primitives: Sequence[Primitive], key: Callable[[Primitive], str]) -> list[Group]:
    """The numbers of primitives by what `key` says of each, in its order."""
    members: dict[str, list[Primitive]] = defaultdict(list)
    for p in primitives:
        members[key(p)].append(p)
    return [group_of(name, members[name]) for name in sorted(members)]


def by_class(primitives: Sequence[Primitive]) -> list[Group]:
    """The numbers by class, in the order of the classes."""
    groups = grouped(primitives, lambda p: p.label)
    return sorted(groups, key=lambda group: CLASSES.index(group.name))
