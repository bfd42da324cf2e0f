"""Pads: which axis and button of SDL is which; one table, a row a family of pads.

Axes of SDL grow to the right and downward, sticks grow forward, left, up, counter-clockwise.
The left stick is forward and left, the right one up and turn, as in the thesis, section 5.1.
"""

from collections.abc import Callable
from dataclasses import dataclass

from common.messages import DecideAction
from services.operator.sources import Deflection, Reading


@dataclass(frozen=True)
class Profile:
    """One family of pads.

    Attributes:
        names: words (lower case) of the names that such pads report.
        vx, vy, vz, wz: an SDL axis and the sign that turns it into ours.
        faces: names of the face buttons by SDL button; they mark ends while data is collected.
        decisions: the buttons that, held together, ask for something.
    """

    names: tuple[str, ...]
    vx: tuple[int, int]
    vy: tuple[int, int]
    vz: tuple[int, int]
    wz: tuple[int, int]
    faces: dict[int, str]
    decisions: dict[DecideAction, tuple[int, ...]]


def _decisions(
    left: int, right: int, select: int, start: int
) -> dict[DecideAction, tuple[int, ...]]:
    """The same on every pad; an emergency takes two buttons, since it stops the motors."""
    return {
        "accept": (right,),
        "cancel": (left,),
        "takeoff": (start,),
        "land": (select,),
        "emergency": (select, start),
    }


PROFILES: dict[str, Profile] = {
    # Linux hid-sony: axes LX LY L2 RX RY R2; cross, circle, triangle, square, L1, R1, L2, R2, ...
    "ps3": Profile(
        names=("playstation", "dualshock", "sixaxis", "ps3"),
        vx=(1, -1),
        vy=(0, -1),
        vz=(4, -1),
        wz=(3, -1),
        faces={0: "cross", 1: "circle", 2: "triangle", 3: "square"},
        decisions=_decisions(left=4, right=5, select=8, start=9),
    ),
    # Linux xpad: axes LX LY LT RX RY RT; A, B, X, Y, LB, RB, back, start, guide, ...
    "xbox": Profile(
        names=("xbox", "x-box", "xinput"),
        vx=(1, -1),
        vy=(0, -1),
        vz=(4, -1),
        wz=(3, -1),
        faces={0: "a", 1: "b", 2: "x", 3: "y"},
        decisions=_decisions(left=4, right=5, select=6, start=7),
    ),
    # Four axes without triggers between them, as autonavx_ardrone reads its pads (1/0/3/2).
    "generic": Profile(
        names=(),
        vx=(1, -1),
        vy=(0, -1),
        vz=(3, -1),
        wz=(2, -1),
        faces={0: "face1", 1: "face2", 2: "face3", 3: "face4"},
        decisions=_decisions(left=4, right=5, select=8, start=9),
    ),
}


def profile_of(pad_name: str) -> Profile:
    """The profile for a pad that reports this name."""
    name = pad_name.lower()
    for profile in PROFILES.values():
        if any(word in name for word in profile.names):
            return profile
    return PROFILES["generic"]


def shaped(axis: float, dead_band: float) -> float:
    """An axis without its dead band: 0 inside, growing from 0 at its edge to 1 at the end."""
    beyond = (abs(axis) - dead_band) / (1.0 - dead_band)
    return 0.0 if beyond <= 0.0 else min(beyond, 1.0) * (1.0 if axis > 0.0 else -1.0)


def read(
    profile: Profile,
    axis: Callable[[int], float],
    button: Callable[[int], bool],
    dead_band: float,
) -> Reading:
    """What the operator's hands do, from a pad's axes in [-1, 1] and buttons."""

    def stick(source: tuple[int, int]) -> float:
        index, sign = source
        return shaped(sign * axis(index), dead_band)

    return Reading(
        Deflection(stick(profile.vx), stick(profile.vy), stick(profile.vz), stick(profile.wz)),
        tuple(name for index, name in profile.faces.items() if button(index)),
        frozenset(action for action, held in profile.decisions.items() if all(map(button, held))),
    )
