"""Sticks in, intents out: which primitive the operator has begun, or none."""

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_S, seconds
from common.messages import NONE_LABEL, ClassifyRequest, Intent, Stick
from common.sticks import DEAD_BAND
from common.topics import TOPICS
from services.classifier.config import Config
from services.classifier.model import Model
from services.classifier.window import WINDOW_S, Array, StickWindow, for_model

LOWEST_RATE_HZ = 5.0
"""Sticks that come more slowly than this do not tell one shape from another."""


class UnusableSamplesError(ValueError):
    """A request's samples or rate cannot be classified; `field` is to blame."""

    def __init__(self, reason: str, field: str) -> None:
        super().__init__(reason)
        self.field = field


class Classifier:
    """Watches the sticks and says what they mean.

    Args:
        config: thresholds.
        model: gives probabilities to a window.
    """

    def __init__(self, config: Config, model: Model) -> None:
        self._config = config
        self._model = model
        self._window = StickWindow()
        self._arrival_ns: int | None = None

    def on_stick(self, stick: Stick, arrival_ns: int) -> None:
        """Take a stick; `arrival_ns` is on the receiver's clock."""
        self._window.add(stick)
        self._arrival_ns = arrival_ns

    def intent(self, now_ns: int, session_ns: int) -> Intent:
        """What the operator means now.

        Args:
            now_ns: on the clock of `on_stick`'s arrivals.
            session_ns: the session's clock, for the stamp as long as there was no stick at all.
        """
        newest_ns = self._window.newest_ns
        if newest_ns is None or self._arrival_ns is None:
            return self._none(session_ns)
        if seconds(now_ns - self._arrival_ns) > TOPICS["stick"].max_age_s:
            return self._none(newest_ns)
        motion = self._window.motion()
        if motion is None:
            return self._none(newest_ns)
        times_s = (motion.stamps_ns - motion.stamps_ns[0]) / NS_PER_S
        return self._classified(
            times_s, motion.sticks, int(motion.stamps_ns[0]), int(motion.stamps_ns[-1])
        )

    def classify(self, request: ClassifyRequest, session_ns: int) -> Intent:
        """The intent of given samples at a constant rate, the newest `WINDOW_S` of them.

        Raises:
            UnusableSamplesError: if a sample is beyond full stick, or the rate is too low.
        """
        if request.rate < LOWEST_RATE_HZ:
            raise UnusableSamplesError(
                f"rate is {request.rate} Hz; at least {LOWEST_RATE_HZ} is needed", "rate"
            )
        sticks = np.array(request.samples, dtype=np.float64)
        if float(np.abs(sticks).max()) > 1.0:
            raise UnusableSamplesError("samples are fractions of full stick, -1 to 1", "samples")
        sticks = sticks[-(int(WINDOW_S * request.rate) + 1) :]
        times_s = np.arange(len(sticks)) / request.rate
        start_ns = session_ns - round(float(times_s[-1]) * NS_PER_S)
        if float(np.abs(sticks).max()) <= DEAD_BAND:
            return self._none(session_ns, start_ns, len(sticks))
        yawless = np.concatenate([sticks, np.zeros((len(sticks), 1))], axis=1)
        return self._classified(times_s, yawless, start_ns, session_ns)

    def _classified(self, times_s: Array, sticks: Array, start_ns: int, end_ns: int) -> Intent:
        if float(times_s[-1]) < self._config.motion_min_s:
            return self._none(end_ns, start_ns, len(sticks))
        window: NDArray[np.float32] = for_model(times_s, sticks, self._config.full_stick_yaw_radps)
        row = self._model.probabilities(window)
        best = int(row.argmax())
        confidence = min(1.0, float(row[best]))
        sure = confidence >= self._config.confidence_min
        return Intent(
            stamp=end_ns,
            seq=0,
            label=self._model.labels[best] if sure else NONE_LABEL,
            probabilities=dict(zip(self._model.labels, map(float, row), strict=True)),
            confidence=confidence,
            window_start=start_ns,
            window_end=end_ns,
            samples=len(sticks),
            model=self._model.name,
        )

    def _none(self, end_ns: int, start_ns: int | None = None, samples: int = 0) -> Intent:
        """No primitive: all are equally (un)likely."""
        labels = self._model.labels
        return Intent(
            stamp=end_ns,
            seq=0,
            label=NONE_LABEL,
            probabilities={label: 1.0 / len(labels) for label in labels},
            confidence=0.0,
            window_start=end_ns if start_ns is None else start_ns,
            window_end=end_ns,
            samples=samples,
            model=self._model.name,
        )
