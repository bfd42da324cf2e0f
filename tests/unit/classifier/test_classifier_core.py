import numpy as np
import pytest
from numpy.typing import NDArray

from common.messages import ClassifyRequest, Stick
from services.classifier.config import Config
from services.classifier.core import Classifier, UnusableSamplesError

STEP_NS = 20_000_000
SESSION_NS = 5 * 10**18


class Fixed:
    """A model that always says the same and remembers what it was shown."""

    name = "fixed-00000000"
    labels = ("line", "arc", "sine", "helix", "spiral")

    def __init__(self, *row: float) -> None:
        self._row = np.array(row)
        self.seen: list[NDArray[np.float32]] = []

    def probabilities(self, sticks: NDArray[np.float32]) -> NDArray[np.float64]:
        self.seen.append(sticks)
        return self._row


@pytest.fixture
def model() -> Fixed:
    return Fixed(0.1, 0.7, 0.1, 0.05, 0.05)


def fly(classifier: Classifier, count: int, start: int = 0, **axes: float) -> int:
    """Send sticks that arrive one second of the receiver's clock after their stamp."""
    full = {"vx": 0.0, "vy": 0.0, "vz": 0.0, "wz": 0.0, **axes}
    for tick in range(start, start + count):
        classifier.on_stick(Stick(stamp=tick * STEP_NS, seq=tick, **full), tick * STEP_NS + 10**9)
    return (start + count - 1) * STEP_NS + 10**9


def test_the_likeliest_primitive_is_the_label(model: Fixed) -> None:
    classifier = Classifier(Config(), model)
    intent = classifier.intent(fly(classifier, 100, vx=0.5), SESSION_NS)
    assert intent.label == "arc"
    assert intent.confidence == 0.7
    assert intent.probabilities == {
        "line": 0.1,
        "arc": 0.7,
        "sine": 0.1,
        "helix": 0.05,
        "spiral": 0.05,
    }
    assert (intent.window_start, intent.window_end) == (0, 99 * STEP_NS)
    assert intent.stamp == intent.window_end
    assert intent.samples == 100
    assert intent.model == "fixed-00000000"


def test_below_the_confidence_the_answer_is_none_with_its_probabilities(model: Fixed) -> None:
    classifier = Classifier(Config(confidence_min=0.71), model)
    intent = classifier.intent(fly(classifier, 100, vx=0.5), SESSION_NS)
    assert intent.label == "none"
    assert intent.confidence == 0.7
    assert intent.probabilities["arc"] == 0.7


def test_before_any_stick_the_answer_is_none_now(model: Fixed) -> None:
    intent = Classifier(Config(), model).intent(0, SESSION_NS)
    assert intent.label == "none"
    assert intent.stamp == SESSION_NS
    assert not model.seen


@pytest.mark.parametrize(
    "axes", [{}, {"wz": 1.0}, {"vx": 0.05}], ids=["neutral", "yaw only", "dead band"]
)
def test_at_rest_the_model_is_not_asked(model: Fixed, axes: dict[str, float]) -> None:
    classifier = Classifier(Config(), model)
    intent = classifier.intent(fly(classifier, 100, **axes), SESSION_NS)
    assert intent.label == "none"
    assert intent.confidence == 0.0
    assert sum(intent.probabilities.values()) == pytest.approx(1.0)
    assert not model.seen


def test_a_motion_that_has_just_begun_is_none(model: Fixed) -> None:
    classifier = Classifier(Config(motion_min_s=0.8), model)
    assert classifier.intent(fly(classifier, 40, vx=0.5), SESSION_NS).label == "none"
    assert classifier.intent(fly(classifier, 2, 40, vx=0.5), SESSION_NS).label == "arc"


def test_sticks_older_than_their_worth_mean_nothing(model: Fixed) -> None:
    classifier = Classifier(Config(), model)
    now_ns = fly(classifier, 100, vx=0.5)
    assert classifier.intent(now_ns + 200_000_000, SESSION_NS).label == "arc"
    assert classifier.intent(now_ns + 201_000_000, SESSION_NS).label == "none"


def test_the_same_sticks_give_the_same_intent(model: Fixed) -> None:
    def run() -> object:
        classifier = Classifier(Config(), model)
        return classifier.intent(fly(classifier, 120, vx=0.5, wz=0.3), SESSION_NS)

    assert run() == run()


def test_yaw_is_seen_through_with_the_vehicles_rate(model: Fixed) -> None:
    classifier = Classifier(Config(full_stick_yaw_radps=2.0), model)
    classifier.intent(fly(classifier, 101, vx=0.5, wz=0.4), SESSION_NS)
    (seen,) = model.seen
    assert np.arctan2(seen[-1, 1], seen[-1, 0]) == pytest.approx(2.0 * 0.4 * 2.0, abs=1e-4)


def test_given_samples_are_classified_at_their_rate(model: Fixed) -> None:
    request = ClassifyRequest(samples=[(0.5, 0.0, 0.1)] * 200, rate=100.0)
    intent = Classifier(Config(), model).classify(request, SESSION_NS)
    assert intent.label == "arc"
    assert intent.window_end == SESSION_NS
    assert intent.window_start == SESSION_NS - 1_990_000_000
    assert len(model.seen[0]) == 100


def test_of_many_samples_the_newest_four_seconds_count(model: Fixed) -> None:
    request = ClassifyRequest(samples=[(0.5, 0.0, 0.1)] * 5000, rate=100.0)
    intent = Classifier(Config(), model).classify(request, SESSION_NS)
    assert intent.samples == 401
    assert len(model.seen[0]) == 200


def test_resting_samples_are_none(model: Fixed) -> None:
    request = ClassifyRequest(samples=[(0.0, 0.01, 0.0)] * 100, rate=50.0)
    assert Classifier(Config(), model).classify(request, SESSION_NS).label == "none"


@pytest.mark.parametrize(
    ("samples", "rate", "field"),
    [([(0.5, 0.0, 0.0)] * 60, 1.0, "rate"), ([(1.5, 0.0, 0.0)] * 60, 50.0, "samples")],
)
def test_samples_that_say_nothing_are_refused(
    model: Fixed, samples: list[tuple[float, float, float]], rate: float, field: str
) -> None:
    with pytest.raises(UnusableSamplesError) as refused:
        Classifier(Config(), model).classify(
            ClassifyRequest(samples=samples, rate=rate), SESSION_NS
        )
    assert refused.value.field == field


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("period_s", 0.05),
        ("period_s", 2.0),
        ("confidence_min", 1.2),
        ("motion_min_s", 0.0),
        ("full_stick_yaw_radps", -1.0),
    ],
)
def test_a_wrong_setting_is_named(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        Config(**{field: value})
