"""Collects primitives one by one while somebody performs them. Pure.

A face button, or the console's end mark, ends a primitive. Pressed again before the sticks move, it
takes the one back that it took; pressed once more, or after a refusal, it takes nothing.
"""

from dataclasses import dataclass
from typing import Literal

from common import messages as m
from common.clock import NS_PER_S
from training.dataset.lengths import PRESETS, Lengths
from training.dataset.primitive import Primitive
from training.dataset.segmentation import at_buttons
from training.dataset.track import TrackBuilder

BOUNCE_S = 0.3
"""A button that is pressed twice within this was pressed once."""
MEMORY_S = 60.0
TRIMMED_S = 5.0
"""What is older than `MEMORY_S` is thrown away so much at a time."""

Verdict = Literal["taken", "refused", "taken back"]


@dataclass(frozen=True)
class Event:
    """What a press of the button did.

    Attributes:
        verdict: what became of what was performed.
        primitive: what was taken.
        reason: why it was refused.
    """

    verdict: Verdict
    primitive: Primitive | None = None
    reason: str = ""


class Collection:
    """Turns sticks into labelled primitives.

    Args:
        label: what is performed.
        operator: who performs.
        family: what kind of people that is.
        source: where the sticks are from.
        lengths: which primitives are kept.
    """

    def __init__(
        self,
        label: str,
        operator: str,
        family: str,
        source: str,
        lengths: Lengths = PRESETS["ours"],
    ) -> None:
        self._label = label
        self._operator = operator
        self._family = family
        self._source = source
        self._lengths = lengths
        self._sticks: list[m.Stick] = []
        self._pressed_ns: int | None = None
        self._is_held = False
        self._took = False

    def add(self, stick: m.Stick) -> Event | None:
        """Take a stick; what the button did, if it went down."""
        was_held, self._is_held = self._is_held, bool(stick.buttons)
        self._sticks.append(stick)
        if not self._is_held or was_held:
            self._trim(stick.stamp)
            return None
        if self._pressed_ns is not None:
            since_ns = stick.stamp - self._pressed_ns
            if 0 <= since_ns < BOUNCE_S * NS_PER_S:
                return None
        self._pressed_ns = stick.stamp
        event = self._end()
        self._took = event.verdict == "taken"
        # The press itself stays: the sticks' way back to rest is no motion (see segmentation).
        self._sticks = [stick]
        return event

    def _trim(self, now_ns: int) -> None:
        if now_ns - self._sticks[0].stamp > (MEMORY_S + TRIMMED_S) * NS_PER_S:
            oldest_ns = now_ns - MEMORY_S * NS_PER_S
            self._sticks = [each for each in self._sticks if each.stamp >= oldest_ns]

    def _end(self) -> Event:
        builder = TrackBuilder(self._source)
        for stick in self._sticks:
            values = (stick.vx, stick.vy, stick.vz, stick.wz)
            builder.add("", stick.stamp / NS_PER_S, values, tuple(stick.buttons or ()))
        tracks = builder.tracks()
        segments = at_buttons(tracks[-1]) if tracks else []
        if not segments:
            if self._took:
                return Event("taken back")
            return Event("refused", reason="no motion before the button")
        track, segment = tracks[-1], segments[-1]
        times_s = track.times_s[segment.begin : segment.end]
        primitive = self._lengths.apply(
            Primitive(
                times_s - times_s[0],
                track.sticks[segment.begin : segment.end],
                self._label,
                self._operator,
                self._family,
                self._source,
                track.utc_ns(segment.begin),
            )
        )
        if isinstance(primitive, str):
            return Event("refused", reason=primitive)
        return Event("taken", primitive)
