"""Whose sticks count: the rules between the operator's own device and the browser's pad. Pure.

A device that is gone, or a console stick older than its maximum age, is neutral at once; after it
comes back it must pass through neutral before it counts again.
"""

from dataclasses import dataclass, field

from common.clock import nanoseconds
from common.messages import DecideAction, Stick
from common.sticks import DEAD_BAND
from common.topics import TOPICS

CONSOLE_MAX_AGE_NS = nanoseconds(TOPICS["console/stick"].max_age_s)


@dataclass(frozen=True)
class Deflection:
    """Where the sticks are: forward, left, up, counter-clockwise as fractions of full stick."""

    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    wz: float = 0.0

    @property
    def is_neutral(self) -> bool:
        """Whether no axis is beyond the dead band."""
        return max(abs(self.vx), abs(self.vy), abs(self.vz), abs(self.wz)) <= DEAD_BAND


NEUTRAL = Deflection()


@dataclass(frozen=True)
class Reading:
    """A device at one moment: sticks, names of the face buttons held, decisions held."""

    sticks: Deflection = NEUTRAL
    buttons: tuple[str, ...] = ()
    decisions: frozenset[DecideAction] = field(default_factory=frozenset)


@dataclass(frozen=True)
class Output:
    """What is sent: sticks and buttons; decisions are those whose buttons went down just now."""

    sticks: Deflection = NEUTRAL
    buttons: tuple[str, ...] = ()
    decisions: tuple[DecideAction, ...] = ()
    is_console: bool = False


class _Gate:
    """Lets sticks through once they have been neutral since they were last lost."""

    def __init__(self) -> None:
        self._open = False

    def pass_on(self, sticks: Deflection | None) -> Deflection:
        if sticks is None:
            self._open = False
        elif sticks.is_neutral:
            self._open = True
        return sticks if sticks is not None and self._open else NEUTRAL


class Sources:
    """Chooses between the operator's own device and the console's stick, every step."""

    def __init__(self) -> None:
        self._own_gate = _Gate()
        self._console_gate = _Gate()
        self._console: Stick | None = None
        self._console_arrival_ns = 0
        self._held: frozenset[DecideAction] = frozenset()

    def console_stick(self, stick: Stick, arrival_ns: int) -> None:
        """Take the browser's newest stick."""
        self._console = stick
        self._console_arrival_ns = arrival_ns
        # A neutral one may be followed by a deflected one before the next step.
        self._console_gate.pass_on(_deflection_of(stick))

    def step(self, now_ns: int, own: Reading | None) -> Output:
        """What to send now; `own` is the device's reading, None while there is no device."""
        held = own.decisions if own is not None else frozenset()
        pressed = tuple(sorted(held - self._held))
        self._held = held
        mine = self._own_gate.pass_on(own.sticks if own is not None else None)
        stick = self._console
        if stick is not None and now_ns - self._console_arrival_ns > CONSOLE_MAX_AGE_NS:
            stick = self._console = None
        theirs = self._console_gate.pass_on(_deflection_of(stick) if stick is not None else None)
        if not theirs.is_neutral:
            return Output(theirs, tuple(stick.buttons or ()) if stick else (), pressed, True)
        return Output(mine, own.buttons if own is not None else (), pressed)


def _deflection_of(stick: Stick) -> Deflection:
    return Deflection(stick.vx, stick.vy, stick.vz, stick.wz)
