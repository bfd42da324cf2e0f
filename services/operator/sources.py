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
        self._is_open = False

    def open(self) -> None:
        """Nobody holds the sticks, though none was heard to be neutral."""
        self._is_open = True

    def pass_on(self, sticks: Deflection | None) -> Deflection:
        if sticks is None:
            self._is_open = False
        elif sticks.is_neutral:
            self._is_open = True
        return sticks if sticks is not None and self._is_open else NEUTRAL


class Sources:
    """Chooses between the operator's own device and the console's stick, every step."""

    def __init__(self) -> None:
        self._own_gate = _Gate()
        self._console_gate = _Gate()
        self._console: Deflection | None = None
        self._console_buttons: tuple[str, ...] = ()
        self._console_ns: int | None = None
        self._begin_ns: int | None = None
        self._held: frozenset[DecideAction] = frozenset()

    def console_stick(self, stick: Stick, arrival_ns: int) -> None:
        """Take the browser's newest stick. It sends while sticks are held, then one neutral."""
        self._console = Deflection(stick.vx, stick.vy, stick.vz, stick.wz)
        self._console_buttons = tuple(stick.buttons or ())
        self._console_ns = arrival_ns
        # A neutral one may be followed by a deflected one before the next step.
        self._console_gate.pass_on(self._console)

    def step(self, now_ns: int, own: Reading | None) -> Output:
        """What to send now; `own` is the device's reading, None while there is no device."""
        held = own.decisions if own is not None else frozenset()
        pressed = tuple(sorted(held - self._held))
        self._held = held
        mine = self._own_gate.pass_on(own.sticks if own is not None else None)
        theirs = self._console_sticks(now_ns)
        if not theirs.is_neutral:
            return Output(theirs, self._console_buttons, pressed, True)
        # A mark of the console says nothing about whose sticks count.
        mine_held = own.buttons if own is not None else ()
        return Output(mine, (*mine_held, *self._console_buttons), pressed)

    def _console_sticks(self, now_ns: int) -> Deflection:
        if self._begin_ns is None:
            self._begin_ns = now_ns
        heard_ns = self._begin_ns if self._console_ns is None else self._console_ns
        if now_ns - heard_ns <= CONSOLE_MAX_AGE_NS:
            return self._console_gate.pass_on(self._console) if self._console else NEUTRAL
        if self._console_ns is None:
            # Silent since the start: a console whose sticks are held would have been heard.
            self._console_gate.open()
        elif self._console is not None and not self._console.is_neutral:
            # Lost while held. Silence after a neutral one is no loss.
            self._console_gate.pass_on(None)
        self._console = None
        self._console_buttons = ()
        return NEUTRAL
