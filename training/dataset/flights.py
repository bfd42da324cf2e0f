"""What became of suggestions in a recorded flight, as labels for the sticks that called for them.

The rule. A suggestion answers the intent before it; its sticks are those of that intent's window.
    accepted    flown for `SOON_S` or to its end: the window is labelled with its primitive
    overridden  accepted, and taken back within `SOON_S` by a stick or by cancel: `none`
    ignored     shown and not accepted, nor any other that shares sticks with it: left out, or
                `none` where asked for: people also ignore what is right
    unclear     ended early by something else than the operator, or by the recording: left out
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from common import messages as m
from common.clock import NS_PER_S, nanoseconds
from training.dataset.primitive import Primitive
from training.dataset.recordings import Logged, read_messages
from training.dataset.track import Problem, utc_or_unknown
from training.labels import CLASSES, NONE

SOON_S = 2.0
"""An autopilot that is left alone for so long is left to fly."""
ANSWER_S = 2.0
"""A suggestion follows its intent within this."""
CROSSED_S = 0.1
"""Two processes publish: a suggestion may reach the recorder before its intent."""
TOPICS_READ = ("stick", "intent", "suggestion", "autopilot")
BY_THE_OPERATOR = ("stick", "cancelled")

Fate = Literal["accepted", "overridden", "ignored", "unclear"]
FATES: tuple[Fate, ...] = ("accepted", "overridden", "ignored", "unclear")


@dataclass(frozen=True)
class Outcome:
    """What became of a suggestion."""

    suggestion: m.Suggestion
    intent: m.Intent
    fate: Fate


@dataclass(frozen=True)
class _Flown:
    """A stretch under the autopilot: along what, when, and why it ended ("": it did not)."""

    suggestion: int
    began_ns: int
    ended_ns: int
    reason: str

    @property
    def fate(self) -> Fate:
        if self.ended_ns - self.began_ns >= nanoseconds(SOON_S) or self.reason == "finished":
            return "accepted"
        return "overridden" if self.reason in BY_THE_OPERATOR else "unclear"


def outcomes_of(logged: Sequence[Logged]) -> list[Outcome]:
    """What became of the suggestions of a flight: those flown, then those that were not.

    A suggestion that is sent again, with a newer intent, is the same one: the intent that counts
    is the newest before it was accepted, and what became last of that window.

    Args:
        logged: intents, suggestions and states of the autopilot as they arrived.
    """
    intents = [(e.log_ns, e.message) for e in logged if isinstance(e.message, m.Intent)]
    offers = []
    for each in logged:
        if isinstance(each.message, m.Suggestion):
            intent = _intent_of(each.log_ns, intents)
            if intent is not None:
                offers.append((each.log_ns, each.message, intent))
    fates: dict[tuple[int, int], Outcome] = {}
    for flown in _flown(logged):
        taken = [
            (suggestion, intent)
            for log_ns, suggestion, intent in offers
            if suggestion.id == flown.suggestion and log_ns <= flown.began_ns
        ]
        if taken:
            suggestion, intent = taken[-1]
            outcome = Outcome(suggestion, intent, flown.fate)
            fates[suggestion.id, intent.window_end] = outcome
    outcomes = list(fates.values())
    ids = {outcome.suggestion.id for outcome in outcomes}
    windows = [outcome.intent for outcome in outcomes]
    newest = {suggestion.id: (suggestion, intent) for _, suggestion, intent in offers}
    outcomes += [
        Outcome(suggestion, intent, "ignored")
        for number, (suggestion, intent) in newest.items()
        if number not in ids and not any(_overlap(intent, other) for other in windows)
    ]
    return outcomes


def _intent_of(log_ns: int, intents: Sequence[tuple[int, m.Intent]]) -> m.Intent | None:
    latest_ns = log_ns + nanoseconds(CROSSED_S)
    near = [
        intent
        for at_ns, intent in intents
        if latest_ns - nanoseconds(ANSWER_S) <= at_ns <= latest_ns and intent.label != NONE
    ]
    return near[-1] if near else None


def _overlap(one: m.Intent, other: m.Intent) -> bool:
    return one.window_start < other.window_end and other.window_start < one.window_end


def _flown(logged: Sequence[Logged]) -> list[_Flown]:
    """Each stretch that the autopilot flew."""
    flown: list[_Flown] = []
    current, began_ns, last_ns = 0, 0, 0
    for each in logged:
        status = each.message
        if not isinstance(status, m.AutopilotStatus):
            continue
        last_ns = each.log_ns
        engaged = status.suggestion if status.mode == "engaged" else 0
        if engaged == current:
            continue
        if current:
            # Taking another suggestion says nothing against the one before.
            reason = "" if engaged else status.reason
            flown.append(_Flown(current, began_ns, last_ns, reason))
        current, began_ns = engaged, last_ns
    if current:
        flown.append(_Flown(current, began_ns, last_ns, ""))
    return flown


def read_flight(
    path: Path, operator: str, family: str, *, ignored_is_none: bool = False
) -> tuple[list[Primitive], dict[Fate, int], list[Problem]]:
    """The labelled sticks of a recorded flight, how many suggestions met which fate, and problems.

    Args:
        path: the recording.
        operator: who flew.
        family: what kind of people that is.
        ignored_is_none: whether suggestions that were ignored are `none`.

    Raises:
        OSError: if it cannot be opened.
    """
    logged, problems = read_messages(path, TOPICS_READ)
    rows = {e.message.stamp: e.message for e in logged if isinstance(e.message, m.Stick)}
    stamps = np.array(sorted(rows), dtype=np.int64)
    outcomes = outcomes_of(logged)
    if not outcomes and not problems:
        problems.append(Problem(str(path), "", "holds no suggestion; fly with autocomplete on"))
    counts: dict[Fate, int] = dict.fromkeys(FATES, 0)
    primitives = []
    for outcome in outcomes:
        counts[outcome.fate] += 1
        label = {"accepted": outcome.suggestion.primitive, "overridden": NONE}.get(outcome.fate)
        if outcome.fate == "ignored" and ignored_is_none:
            label = NONE
        if label is None:
            continue
        where = f"suggestion {outcome.suggestion.id}"
        begin, end = outcome.intent.window_start, outcome.intent.window_end
        inside = stamps[(stamps >= begin) & (stamps <= end)]
        if len(inside) < 2:
            problems.append(Problem(str(path), where, "its sticks are not in the recording"))
            continue
        if label not in CLASSES:
            problems.append(Problem(str(path), where, f"primitive {label!r} is no known class"))
            continue
        window = [rows[int(stamp)] for stamp in inside]
        primitives.append(
            Primitive(
                (inside - inside[0]) / NS_PER_S,
                np.array([(s.vx, s.vy, s.vz, s.wz) for s in window]),
                label,
                operator,
                family,
                f"{path.name} suggestion {outcome.suggestion.id} {outcome.fate}",
                utc_or_unknown(int(inside[0])),
            )
        )
    return primitives, counts, problems
