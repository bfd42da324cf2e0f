import numpy as np
import pytest
from numpy.typing import NDArray

from common.messages import ClassifyRequest, Stick, VehicleStatus
from services.classifier.config import Config
from services.classifier.core import Classifier, UnusableSamplesError
from services.classifier.model import SHORTEST_SAMPLES, Answer, ModelError
from services.classifier.window import WINDOW_S, WINDOW_SAMPLES

STEP_NS = 20_000_000
SESSION_NS = 5 * 10**18


class Fixed:
    """A model that always says the same and remembers what it was shown."""

    name = "fixed-00000000"
    labels = ("line", "arc", "sine", "helix", "spiral")
    confidence_min = 0.6

    def __init__(self, *row: float, meant: float = 1.0) -> None:
        self._answer = Answer(np.array(row), meant)
        self.fails = False
        self.seen: list[NDArray[np.float32]] = []
        self.yaw_radps: list[float] = []

    def answer(self, sticks: NDArray[np.float32], full_yaw_radps: float) -> Answer:
        if self.fails:
            raise ModelError("model m.onnx: fails on 100 samples")
        self.seen.append(sticks.copy())
        self.yaw_radps.append(full_yaw_radps)
        return self._answer


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


def test_confidence_is_that_a_primitive_is_meant_and_this_one() -> None:
    classifier = Classifier(Config(), Fixed(0.0, 0.9, 0.1, 0.0, 0.0, meant=0.8))
    intent = classifier.intent(fly(classifier, 100, vx=0.5), SESSION_NS)
    assert intent.label == "arc"
    assert intent.confidence == pytest.approx(0.72)
    assert intent.probabilities["arc"] == pytest.approx(0.9)


@pytest.mark.parametrize(("least", "label"), [(0.69, "arc"), (0.71, "none")])
def test_how_sure_is_sure_enough_is_the_models_to_say(
    model: Fixed, least: float, label: str
) -> None:
    model.confidence_min = least
    classifier = Classifier(Config(), model)
    assert classifier.intent(fly(classifier, 100, vx=0.5), SESSION_NS).label == label


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
    classifier = Classifier(Config(), model)
    now_ns = fly(classifier, SHORTEST_SAMPLES - 1, vx=0.5)
    assert classifier.intent(now_ns, SESSION_NS).label == "none"
    now_ns = fly(classifier, 1, SHORTEST_SAMPLES - 1, vx=0.5)
    assert classifier.intent(now_ns, SESSION_NS).label == "arc"
    assert len(model.seen[0]) == SHORTEST_SAMPLES


def test_a_model_that_fails_means_nothing_and_is_told_of(model: Fixed) -> None:
    classifier = Classifier(Config(), model)
    now_ns = fly(classifier, 100, vx=0.5)
    model.fails = True
    assert classifier.intent(now_ns, SESSION_NS).label == "none"
    assert "fails on 100 samples" in classifier.fault
    model.fails = False
    assert classifier.intent(now_ns, SESSION_NS).label == "arc"
    assert classifier.fault == ""


def test_a_model_is_exchanged_between_two_windows(model: Fixed) -> None:
    classifier = Classifier(Config(), model)
    now_ns = fly(classifier, 100, vx=0.5)
    assert classifier.intent(now_ns, SESSION_NS).label == "arc"
    classifier.model = Fixed(0.0, 0.0, 1.0, 0.0, 0.0)
    intent = classifier.intent(now_ns, SESSION_NS)
    assert intent.label == "sine"
    assert intent.samples == 100


def test_sticks_whose_stamps_stand_still_are_none(model: Fixed) -> None:
    classifier = Classifier(Config(), model)
    now_ns = fly(classifier, 100, vx=0.5)
    stuck = Stick(stamp=99 * STEP_NS, seq=0, vx=0.5, vy=0.0, vz=0.0, wz=0.0)
    for _ in range(30):
        now_ns += STEP_NS
        classifier.on_stick(stuck, now_ns)
    assert classifier.intent(now_ns, SESSION_NS).label == "none"


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


@pytest.mark.parametrize(("plant", "yaw_radps"), [(None, 1.0), ("tum", 1.0), ("ardrone", 1.571)])
def test_the_yaw_rate_is_that_of_what_is_flown(
    model: Fixed, plant: str | None, yaw_radps: float
) -> None:
    classifier = Classifier(Config(), model)
    if plant is not None:
        classifier.on_vehicle(
            VehicleStatus(
                stamp=0,
                seq=0,
                state="flying",
                battery=1.0,
                world="track",
                plant=plant,  # type: ignore[arg-type]
                collisions=0,
            ),
            0,
        )
    classifier.intent(fly(classifier, 100, vx=0.5, wz=0.4), SESSION_NS)
    assert model.yaw_radps == pytest.approx([yaw_radps], abs=1e-3)
    assert model.seen[0][0] == pytest.approx([0.5, 0.0, 0.0, 0.4])


def test_a_yaw_rate_that_is_set_goes_before_the_plants(model: Fixed) -> None:
    classifier = Classifier(Config(full_stick_yaw_radps=2.0), model)
    classifier.intent(fly(classifier, 100, vx=0.5), SESSION_NS)
    assert model.yaw_radps == [2.0]


def test_given_samples_are_classified_at_their_rate(model: Fixed) -> None:
    request = ClassifyRequest(samples=[(0.5, 0.0, 0.1)] * 200, rate=100.0)
    intent = Classifier(Config(), model).classify(request, SESSION_NS)
    assert intent.label == "arc"
    assert intent.window_end == SESSION_NS
    assert intent.window_start == SESSION_NS - 1_990_000_000
    assert len(model.seen[0]) == 100


def test_of_many_samples_the_newest_window_counts(model: Fixed) -> None:
    request = ClassifyRequest(samples=[(0.5, 0.0, 0.1)] * 5000, rate=100.0)
    intent = Classifier(Config(), model).classify(request, SESSION_NS)
    assert intent.samples == WINDOW_S * 100 + 1
    assert len(model.seen[0]) == WINDOW_SAMPLES


def test_of_given_samples_the_newest_motion_counts(model: Fixed) -> None:
    rest, moving = (0.0, 0.0, 0.0), (0.5, 0.0, 0.1)
    samples = [moving] * 60 + [rest] * 30 + [moving] * 40 + [rest] * 10 + [moving] * 50 + [rest] * 9
    intent = Classifier(Config(), model).classify(
        ClassifyRequest(samples=samples, rate=50.0), SESSION_NS
    )
    assert intent.samples == 100
    assert intent.window_end == SESSION_NS - 9 * STEP_NS
    assert intent.window_start == intent.window_end - 99 * STEP_NS
    assert len(model.seen[0]) == 100


@pytest.mark.parametrize("rate_hz", [20.0, 33.0, 50.0, 100.0])
def test_given_samples_mean_what_they_mean_in_flight(model: Fixed, rate_hz: float) -> None:
    times_s = np.arange(int(3.0 * rate_hz)) / rate_hz
    rows = np.stack([np.cos(times_s), np.sin(times_s), 0.2 * times_s], axis=1)
    classifier = Classifier(Config(), model)
    for seq, (time_s, (vx, vy, vz)) in enumerate(zip(times_s, rows.tolist(), strict=True)):
        stamp = 10**18 + round(time_s * 1e9)
        classifier.on_stick(Stick(stamp=stamp, seq=seq, vx=vx, vy=vy, vz=vz, wz=0.0), 0)
    flown = classifier.intent(0, SESSION_NS)
    given = classifier.classify(
        ClassifyRequest(samples=[tuple(row) for row in rows.tolist()], rate=rate_hz), SESSION_NS
    )
    assert given.samples == flown.samples == len(rows)
    assert model.seen[0] == pytest.approx(model.seen[1], abs=1e-5)


def test_resting_samples_are_none(model: Fixed) -> None:
    request = ClassifyRequest(samples=[(0.0, 0.01, 0.0)] * 100, rate=50.0)
    assert Classifier(Config(), model).classify(request, SESSION_NS).label == "none"


@pytest.mark.parametrize(
    ("samples", "rate", "field"),
    [
        ([(0.5, 0.0, 0.0)] * 60, 19.0, "rate"),
        ([(0.5, 0.0, 0.0)] * 60, 101.0, "rate"),
        ([(1.5, 0.0, 0.0)] * 60, 50.0, "samples"),
    ],
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
        ("full_stick_yaw_radps", -1.0),
    ],
)
def test_a_wrong_setting_is_named(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        Config(**{field: value})
