"""Folds keep people apart; verdicts say what is met; the report is written from any results."""

from collections.abc import Callable

import numpy as np
import pytest

from cli.main import main
from common.clock import ManualClock, nanoseconds
from services.classifier.model import Answer
from training.dataset.primitive import Primitive
from training.evaluation import figures, folds
from training.evaluation.bars import at_least, at_most, bars
from training.evaluation.contenders import CONTENDERS, contender
from training.evaluation.distortions import DISTORTIONS
from training.evaluation.folds import SEEDS, Size, fold
from training.evaluation.hover import LEAD_S, Bothered, bothered, shown
from training.evaluation.latency import latency
from training.evaluation.measures import Tally
from training.evaluation.names import CALIBRATED, EVERYTHING, FAMILY, KNOWN, LITE, MOMENTS, OURS
from training.evaluation.report import tables_of, write
from training.evaluation.results import Results
from training.generator.nothing import KINDS
from training.generator.people import FAMILIES
from training.labels import NONE, PRIMITIVES

TINY = Size(24, 0.02, 16, 0.02, 0.25, 8, 0.01, 1, 500)


def quiet(_done: int, _of: int) -> None:
    pass


def populate(population, operators: int, counts: dict[str, int], seed: int) -> list[Primitive]:
    """As the generator's, without people in it."""
    members = [population.families[k % len(population.families)].name for k in range(operators)]
    times_s = np.arange(90) / 45.0
    return [
        Primitive(
            times_s,
            np.full((90, 4), 0.3),
            label,
            f"{members[turn % operators]}-{turn % operators}",
            members[turn % operators],
            f"{population.name} {seed}",
        )
        for label, count in counts.items()
        for turn in range(count)
    ]


def test_no_person_is_learned_from_and_judged_on_and_left_out_families_are_unseen(
    monkeypatch,
) -> None:
    monkeypatch.setattr(folds, "populate", populate)
    made = fold(1, TINY, quiet)
    learned = {p.operator for p in made.lesson.training}
    chosen = {p.operator for p in made.lesson.validation}
    judged = {p.operator for people in made.tests.values() for p in people}
    assert not learned & chosen
    assert not (learned | chosen) & judged
    assert made.left_out
    seen = {p.family for p in (*made.lesson.training, *made.lesson.validation)}
    assert not seen & set(made.left_out)
    assert {p.family for p in made.tests[CALIBRATED]} <= seen
    assert list(made.none) == list(KINDS)
    assert NONE in {p.label for p in made.lesson.training}
    assert made.lesson.windows.labels.max() < len(PRIMITIVES)


def test_each_family_is_left_out_of_one_seed() -> None:
    out = [family.name for seed in range(SEEDS) for family in FAMILIES[seed::SEEDS]]
    assert sorted(out) == sorted(family.name for family in FAMILIES)


def test_every_classifier_has_the_name_it_is_asked_for_by() -> None:
    pytest.importorskip("aeon")
    installed = [name for name in CONTENDERS if name != LITE]  # it alone wants TensorFlow
    assert [contender(name).name for name in installed] == installed
    with pytest.raises(ValueError, match="unknown; use cnn-gru"):
        contender("nobody")


class Stub:
    """A model that always says the same."""

    name = "stub"
    labels = PRIMITIVES
    confidence_min = 0.5

    def __init__(self, meant: float, ask: Callable[[], None] = lambda: None) -> None:
        self._meant = meant
        self._ask = ask

    def answer(self, sticks: np.ndarray, full_yaw_radps: float) -> Answer:
        self._ask()
        return Answer(np.array([0.97, 0.01, 0.01, 0.01]), self._meant)


def pushing(seconds: float, *, moves: bool) -> tuple[Primitive, np.ndarray]:
    """Sticks forward, and where the vehicle is: on its way, or held by something."""
    times_s = np.arange(round((LEAD_S + seconds) * 50)) / 50.0
    sticks = np.tile([0.4, 0.0, 0.0, 0.0], (len(times_s), 1))
    places = np.zeros((len(times_s), 4))
    places[:, 0] = 0.4 * times_s if moves else 0.0
    return Primitive(times_s, sticks, NONE, "o", "f", "test"), places


def test_suggestions_are_counted_through_the_services_own_cores() -> None:
    flown = [pushing(10.0, moves=True)] * 2
    sure = bothered(Stub(1.0), flown, 1.0)
    assert (sure.people, sure.asked, sure.intents, sure.bothered) == (2, 18, 18, 2)
    assert sure.suggestions > 10
    assert bothered(Stub(0.1), flown, 1.0).intents == 0


def test_intents_of_a_vehicle_that_stays_are_no_suggestions() -> None:
    stayed = bothered(Stub(1.0), [pushing(10.0, moves=False)], 1.0)
    assert (stayed.intents, stayed.suggestions, stayed.bothered) == (9, 0, 0)


def test_a_suggestion_is_on_the_screen_until_it_is_too_old_or_another_comes() -> None:
    given_ns = [nanoseconds(at_s) for at_s in (1.0, 2.0, 10.0, 19.0)]
    assert shown(given_ns, 20.0) == pytest.approx(4.0 + 3.0 + 1.0)


def test_latency_is_that_of_single_windows() -> None:
    clock = ManualClock()
    found = latency(Stub(1.0, lambda: clock.advance(0.001)), clock, 50)
    assert found.p50_s == pytest.approx(0.001)
    assert found.p99_s == pytest.approx(0.001)
    assert nanoseconds(found.p50_s) == 1_000_000


def test_verdicts_say_by_how_much_a_bar_is_missed() -> None:
    assert at_least(0.97, 0.97) == "met"
    assert at_least(0.95, 0.97) == "short by 0.020"
    assert at_most(3.1, 2.0, 1) == "over by 1.1"


def result(right: float, families: list[str]) -> dict:
    def counts(share: float) -> dict:
        swapped = round(100 * (1.0 - share))
        confusion = np.diag([100 - swapped] * 4) + np.roll(np.diag([swapped] * 4), 1, axis=1)
        bins = np.zeros((15, 3))
        bins[12] = 400, 400 * share, 400 * share
        return Tally(confusion, bins).to_json()

    names = [CALIBRATED, KNOWN, *(FAMILY + family for family in families)]
    return {
        "fit_s": 1.0,
        "sets": {name: {moment: counts(right) for moment in MOMENTS} for name in names},
        "distorted": {name: counts(right - 0.01) for name in DISTORTIONS},
        "history": [(1.0, 1.1), (0.5, 0.6)],
        "answered": {
            name: {moment: [400, 300, 290] for moment in MOMENTS} for name in names if name != KNOWN
        },
        "none": {
            kind: {
                moment: {"auroc": 0.98, "n": 800.0, "answered": 0.01}
                for moment in (*MOMENTS, EVERYTHING)
            }
            for kind in (EVERYTHING, "hover")
        },
        "adapted": [
            {
                "kind": kind,
                "own_before": 0.8,
                "own_after": after,
                "others_before": 0.9,
                "others_after": 0.89,
            }
            for kind, after in (("odd", 0.85), ("clumsy", 0.8))
        ],
        "hover": {
            period: vars(Bothered(20, 1180, 3, given, given, 2.5 * given, given))
            for period, given in (("1.0", 0), ("0.1", 1))
        },
    }


def results(ours: float, peer: float) -> Results:
    judged = {
        name: {0: result(right, ["calm"]), 1: result(right, ["wild"])}
        for name, right in ((OURS, ours), ("svm", peer), ("cnn-gru-thesis", 0.5))
    }
    human = {"GunPoint": {0: {"ours": 0.99, "padded": 0.98, "stretched": 0.97, "n": 150.0}}}
    return Results(judged, human, {"LITETime": "too slow"}, {}, (0.80, 0.81))


def test_a_bar_is_met_only_above_every_peer() -> None:
    verdicts = {bar.question: bar.verdict for bar in bars(results(0.98, 0.99))}
    assert verdicts["F1, calibrated people held out"] == "not met: 0.010 below a peer"
    assert verdicts["F1, family left out: wild"] == "not met: 0.010 below a peer"
    assert verdicts["none against the four, AUROC, all moments"] == "met"
    assert verdicts["people: GunPoint, accuracy"] == "met"
    assert verdicts["F1 gained by 5 examples a class, 2 people with odd ways"] == "met"
    assert verdicts["F1 that others lose by it"] == "over by 0.5"
    verdicts = {bar.question: bar.verdict for bar in bars(results(0.98, 0.98))}
    assert verdicts["F1, calibrated people held out"] == "not met: level with a peer"
    verdicts = {bar.question: bar.verdict for bar in bars(results(0.98, 0.90))}
    assert verdicts["F1, calibrated people held out"] == "met"
    verdicts = {bar.question: bar.verdict for bar in bars(results(0.92, 0.95))}
    assert verdicts["F1, family left out: calm"] == "short by 0.010, 0.030 below a peer"


def test_a_peer_of_fewer_seeds_is_compared_on_those_it_has() -> None:
    found = results(0.98, 0.90)
    found.judged[OURS][1] = result(0.92, ["wild"])
    found.judged["svm"] = {0: result(0.97, ["calm"])}
    rows = {bar.question: bar for bar in bars(found)}
    row = rows["F1, calibrated people held out"]
    assert row.found.startswith("0.950 ±")
    assert row.peer == "svm 0.970 (1 of 2; ours on these 0.980)"
    assert row.verdict == "short by 0.020"
    assert rows["F1, family left out: calm"].peer == "svm 0.970"
    assert rows["F1, family left out: wild"].peer == "cnn-gru-thesis 0.500"
    headers = [name for table in tables_of(found) for name in (*table.header, *table.rows[0])]
    assert "svm (1 of 2 seeds)" in headers


def test_the_report_is_markdown_html_and_pictures(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(figures, "populate", populate)
    write(results(0.98, 0.90), tmp_path)
    text = (tmp_path / "report.md").read_text()
    assert "| F1, calibrated people held out | >= 0.97, above peers |" in text
    assert "not run: too slow" in text
    page = (tmp_path / "report.html").read_text()
    assert '<td class="met">met</td>' in page
    pictures = {path.name for path in tmp_path.glob("*.png")}
    names = {"bars", "early", "answered", "families", "reliability", "confusion", "losses"}
    assert {f"{name}.png" for name in names} <= pictures
    assert "| suggestions in 60 s of hover corrections, T = 0.1 s | none | 2 of 2360 (" in text
    for name in pictures:
        assert f"]({name})" in text
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_a_report_needs_no_network_of_ours(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(figures, "populate", populate)
    found = results(0.98, 0.90)
    del found.judged[OURS]
    assert [table.title for table in write(found, tmp_path)][1] == (
        "Classifiers, at the end of a primitive"
    )


def test_an_unknown_classifier_is_refused_in_one_line(capsys, tmp_path) -> None:
    assert main(["evaluate", "--models", "nobody", "--out", str(tmp_path / "e")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "'nobody': use cnn-gru, " in error
