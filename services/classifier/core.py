"""Sticks in, intents out: which primitive the operator has begun, or none."""

import itertools

import numpy as np

from common.clock import NS_PER_S, seconds
from common.messages import NONE_LABEL, ClassifyRequest, Intent, Stick, VehicleStatus
from common.sticks import FULL_STICK, full_stick_of
from common.topics import TOPICS
from services.classifier.config import Config
from services.classifier.model import SHORTEST_SAMPLES, Model, ModelError
from services.classifier.window import (
    WINDOW_S,
    WINDOW_SAMPLES,
    Motion,
    StickWindow,
    at_rate,
    newest_motion,
)

LOWEST_RATE_HZ, HIGHEST_RATE_HZ = 20.0, 100.0
"""Rates of given samples: of pads and browsers, and what robustness was tested at."""
_PLANT = "tum"
"""What is flown as long as the vehicle has not said."""


class UnusableSamplesError(ValueError):
    """A request's samples or rate cannot be classified; `field` is to blame."""

    def __init__(self, reason: str, field: str) -> None:
        super().__init__(reason)
        self.field = field


class Classifier:
    """Watches the sticks and says what they mean.

    `none` is said where there is no motion to ask the model about (no stick for 0.2 s, sticks at
    rest, a motion of less than `SHORTEST_SAMPLES`), and where the model is less confident than its
    calibration asks for.

    Args:
        config: settings.
        model: says what a window means; may be exchanged at any time.

    Attributes:
        model: as above.
        fault: why the model gave no answer when it was last asked, or "".
    """

    def __init__(self, config: Config, model: Model) -> None:
        self.model = model
        self.fault = ""
        self._config = config
        self._window = StickWindow()
        self._arrival_ns: int | None = None
        self._full = FULL_STICK[_PLANT]

    def on_stick(self, stick: Stick, arrival_ns: int) -> None:
        """Take a stick; `arrival_ns` is on the receiver's clock."""
        if self._window.add(stick):
            self._arrival_ns = arrival_ns

    def on_vehicle(self, status: VehicleStatus, _arrival_ns: int) -> None:
        """Take what is flown: its yaw rate tells how far a held yaw stick turns it."""
        self._full = full_stick_of(status)

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
        return self._none(newest_ns) if motion is None else self._meaning(motion)

    def classify(self, request: ClassifyRequest, session_ns: int) -> Intent:
        """The intent of the newest motion in given samples at a constant rate, as in flight.

        Raises:
            UnusableSamplesError: if a sample is beyond full stick, or the rate is out of range.
        """
        rate_hz = request.rate
        if not LOWEST_RATE_HZ <= rate_hz <= HIGHEST_RATE_HZ:
            raise UnusableSamplesError(
                f"rate is {rate_hz:g} Hz; use {LOWEST_RATE_HZ:g} to {HIGHEST_RATE_HZ:g}", "rate"
            )
        values = itertools.chain.from_iterable(request.samples)
        # Half of the time of np.array, which looks at each tuple twice.
        sticks = np.fromiter(values, np.float64, 3 * len(request.samples)).reshape(-1, 3)
        if float(np.abs(sticks).max()) > 1.0:
            raise UnusableSamplesError("samples are fractions of full stick, -1 to 1", "samples")
        span = newest_motion(sticks, rate_hz)
        end_ns = session_ns - round((len(sticks) - span.stop) / rate_hz * NS_PER_S)
        if span.start == span.stop:
            return self._none(session_ns)
        moved = sticks[span][-(int(WINDOW_S * rate_hz) + 1) :]
        yawless = np.concatenate([moved, np.zeros((len(moved), 1))], axis=1)
        rows = at_rate(np.arange(len(moved)) / rate_hz, yawless)[-WINDOW_SAMPLES:]
        start_ns = end_ns - round((len(moved) - 1) / rate_hz * NS_PER_S)
        return self._meaning(Motion(rows.astype(np.float32), start_ns, end_ns, len(moved)))

    def _meaning(self, motion: Motion) -> Intent:
        if len(motion.sticks) < SHORTEST_SAMPLES:
            return self._none(motion.end_ns, motion)
        try:
            answer = self.model.answer(motion.sticks, self._full_yaw_radps())
        except ModelError as error:
            self.fault = str(error)
            return self._none(motion.end_ns, motion)
        self.fault = ""
        best = int(answer.probabilities.argmax())
        confidence = min(1.0, answer.meant * float(answer.probabilities[best]))
        least = self._config.confidence_min
        sure = confidence >= (self.model.confidence_min if least is None else least)
        labels = self.model.labels
        return Intent(
            stamp=motion.end_ns,
            seq=0,
            label=labels[best] if sure else NONE_LABEL,
            probabilities=dict(zip(labels, answer.probabilities.tolist(), strict=True)),
            confidence=confidence,
            window_start=motion.start_ns,
            window_end=motion.end_ns,
            samples=motion.sources,
            model=self.model.name,
        )

    def _full_yaw_radps(self) -> float:
        radps = self._config.full_stick_yaw_radps
        return self._full.yaw_radps if radps is None else radps

    def _none(self, end_ns: int, motion: Motion | None = None) -> Intent:
        """No primitive: all are equally (un)likely."""
        labels = self.model.labels
        return Intent(
            stamp=end_ns,
            seq=0,
            label=NONE_LABEL,
            probabilities={label: 1.0 / len(labels) for label in labels},
            confidence=0.0,
            window_start=end_ns if motion is None else motion.start_ns,
            window_end=end_ns,
            samples=0 if motion is None else motion.sources,
            model=self.model.name,
        )
