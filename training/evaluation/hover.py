"""What a person who only holds the vehicle in its place would be bothered with.

Sticks go through the classifier's own core, and what it takes for a primitive through that of
synthesis, which knows where the vehicle was and may refuse.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import nanoseconds, seconds
from common.messages import NONE_LABEL, Pose, Stick, Suggestion
from common.topics import TOPICS
from services.classifier.config import Config as ClassifierConfig
from services.classifier.core import Classifier
from services.classifier.model import Model
from services.synthesis.config import Config as SynthesisConfig
from services.synthesis.core import Synthesizer
from training.dataset.primitive import Primitive
from training.generator.noise import STEP_S

Array = NDArray[np.float64]

HOLD_S = 60.0
LEAD_S = 5.0
"""Before these a place is held, unasked: a vehicle is known of since it took off, and nobody is
handed one in the middle of a correction."""
HEIGHT_M = 1.5
"""Of the place that is held; high enough that no suggestion is refused for the ground."""
COVARIANCE = (1e-4,) * 6
"""Of a good localizer's pose."""


@dataclass(frozen=True)
class Bothered:
    """What came of it.

    Attributes:
        people: who held a place for `HOLD_S`.
        asked: intents.
        intents: those that are not `none`.
        suggestions: those of them that synthesis made a path of.
        different: of these, how many had a number of their own: arrows that came or jumped.
        shown_s: so long there were arrows on the screen, of all people together.
        bothered: people who got a suggestion.
    """

    people: int
    asked: int
    intents: int
    suggestions: int
    different: int
    shown_s: float
    bothered: int


def bothered(model: Model, holds: Sequence[tuple[Primitive, Array]], period_s: float) -> Bothered:
    """Let people hold a place, asked every `period_s` after the first `LEAD_S`.

    Args:
        model: of the classifier.
        holds: of each person the sticks, and x y z in m and yaw in rad (N, 4) every `STEP_S`, for
            `LEAD_S` and as long as they are asked.
        period_s: T.
    """
    asked, intents, suggestions, different, people = 0, 0, 0, 0, 0
    shown_s = 0.0
    period_ns = nanoseconds(period_s)
    for hold, places in holds:
        classifier = Classifier(ClassifierConfig(), model)
        synthesizer = Synthesizer(SynthesisConfig())
        poses = _poses(places)
        flown, due_ns = 0, nanoseconds(LEAD_S) + period_ns
        given: list[tuple[int, int]] = []
        for seq, (time_s, stick) in enumerate(
            zip(hold.times_s.tolist(), hold.sticks.tolist(), strict=True)
        ):
            now_ns = nanoseconds(time_s)
            while flown < len(poses) and poses[flown].stamp <= now_ns:
                synthesizer.on_pose(poses[flown], poses[flown].stamp)
                flown += 1
            while now_ns >= due_ns:
                intent = classifier.intent(due_ns, due_ns)
                asked += 1
                intents += intent.label != NONE_LABEL
                suggestion = synthesizer.on_intent(intent, due_ns)
                if isinstance(suggestion, Suggestion):
                    given.append((suggestion.id, due_ns))
                due_ns += period_ns
            classifier.on_stick(_stick(now_ns, seq, *stick), now_ns)
        suggestions += len(given)
        different += len({number for number, _ in given})
        shown_s += shown([due_ns for _, due_ns in given], hold.times_s[-1])
        people += bool(given)
    return Bothered(len(holds), asked, intents, suggestions, different, shown_s, people)


def shown(given_ns: Sequence[int], end_s: float) -> float:
    """For how many s, until `end_s`, suggestions that came at these times are on the screen."""
    total_s, until_s = 0.0, 0.0
    for at_ns in given_ns:
        begin_s = max(seconds(at_ns), until_s)
        until_s = min(seconds(at_ns) + TOPICS["suggestion"].max_age_s, end_s)
        total_s += max(0.0, until_s - begin_s)
    return total_s


def _poses(places: Array) -> list[Pose]:
    """What a localizer would say of these places."""
    velocities = np.gradient(places[:, :3], STEP_S, axis=0).tolist()
    return [
        Pose(
            stamp=nanoseconds(seq * STEP_S),
            seq=seq,
            position=(x, y, z + HEIGHT_M),
            orientation=(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)),
            velocity=tuple(velocity),
            angular_velocity=(0.0, 0.0, 0.0),
            covariance=COVARIANCE,
            status="ok",
            source="truth",
        )
        for seq, ((x, y, z, yaw), velocity) in enumerate(
            zip(places.tolist(), velocities, strict=True)
        )
    ]


def _stick(stamp: int, seq: int, vx: float, vy: float, vz: float, wz: float) -> Stick:
    return Stick(stamp=stamp, seq=seq, vx=vx, vy=vy, vz=vz, wz=wz)
