"""Which vehicles there are: what `--vehicles` says of their number, kinds and names."""

import string
from dataclasses import dataclass

from common.topics import VEHICLE_PATTERN
from services.sim import plants

MOST = 16
"""Vehicles of one simulator."""


@dataclass(frozen=True)
class Member:
    """A vehicle: the name of its plant, and its own, if it was given one."""

    plant: str
    name: str | None = None


def crew_of(vehicles: int | str, plant: str) -> tuple[Member, ...]:
    """The vehicles that a number or a text stands for.

    Args:
        vehicles: how many, or a plant for each, separated by commas; NAME=PLANT names it.
        plant: what they are if it is a number.

    Raises:
        ValueError: if it stands for none; the text says what is allowed.
    """
    text = str(vehicles).strip()
    if text.removeprefix("-").isdecimal():
        members = (Member(plant),) * max(0, min(int(text), MOST + 1))
    else:
        members = tuple(_member(word.strip()) for word in text.split(","))
    if not 1 <= len(members) <= MOST:
        raise ValueError(f"1 to {MOST} vehicles, not {text}")
    return members


def _member(word: str) -> Member:
    name, named, plant = word.rpartition("=")
    if named and not VEHICLE_PATTERN.fullmatch(name):
        raise ValueError(f"{name!r} names no vehicle; use 1 to 32 of a-z 0-9 _ -")
    if plant not in plants.names():
        raise ValueError(
            f"{word!r} is no vehicle; write a number, or PLANT or NAME=PLANT for each,"
            f" separated by commas; plants are {', '.join(plants.names())}"
        )
    return Member(plant, name if named else None)


def names_of(members: tuple[Member, ...], first: str) -> tuple[str, ...]:
    """The vehicles' names: those without one count on from the first's, as drone0, drone1, ...

    Args:
        members: the vehicles.
        first: the name of the first.

    Raises:
        ValueError: if a name cannot be used, or two have the same.
    """
    if members[0].name not in (None, first):
        raise ValueError(f"the first is {first!r}; name it by --vehicle {members[0].name}")
    stem = first.rstrip(string.digits)
    number = int(first[len(stem) :] or 0)
    names = [first]
    for offset, member in enumerate(members[1:], start=1):
        names.append(member.name or f"{stem}{number + offset}")
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ValueError(f"two are named {min(twice)!r}; name each of them otherwise")
    for name in names:
        if not VEHICLE_PATTERN.fullmatch(name):
            raise ValueError(f"{name!r} names no vehicle; use 1 to 32 of a-z 0-9 _ -")
    return tuple(names)
