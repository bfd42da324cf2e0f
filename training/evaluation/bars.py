"""Against each bar: what was found, whether it is met, and by how much it is missed."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from services.classifier.window import WINDOW_S
from training.evaluation.distortions import UNCHANGED
from training.evaluation.human import HUMAN_SETS
from training.evaluation.measures import Estimate, Tally, estimate
from training.evaluation.names import CALIBRATED, EVERYTHING, FAMILY, MOMENTS, OURS, WHOLE
from training.evaluation.results import Results, pooled

CALIBRATED_F1 = 0.97
ARC_SINE = 0.03
FAMILY_F1 = 0.93
EARLY_F1 = {"1.0 s": 0.70, "1.5 s": 0.80, "2.0 s": 0.88, "3.0 s": 0.93}
CALIBRATION_ERROR = 0.03
NONE_AUROC = 0.97
ROBUST_POINTS = 2.0
LEVEL = 5e-4
"""F1 that differ by less look the same in a table."""
GAINED_POINTS, LOST_POINTS = 3.0, 0.5
P50_S, P99_S = 0.2e-3, 0.3e-3
Asked = Callable[[Results, str], Estimate]
"""A figure of a classifier."""


@dataclass(frozen=True)
class Bar:
    """One demand and what became of it.

    Attributes:
        question: what is asked.
        bar: what it should be.
        found: ours.
        peer: the best of the others, where they can be asked.
        verdict: "met", or by how much it is missed.
    """

    question: str
    bar: str
    found: str
    peer: str
    verdict: str


def at_least(found: float, bar: float, digits: int = 3) -> str:
    """Met, or short by how much."""
    return "met" if found >= bar else f"short by {bar - found:.{digits}f}"


def at_most(found: float, bar: float, digits: int = 3) -> str:
    """Met, or over by how much."""
    return "met" if found <= bar else f"over by {found - bar:.{digits}f}"


def _best(
    results: Results, of: Asked, digits: int = 3, scale: float = 1.0, *, least: bool = False
) -> tuple[str, float]:
    """The best peer, and how far it is ahead of ours on the seeds that both have.

    Args:
        results: of the evaluation.
        of: a figure of a classifier.
        digits: of the figure in the text.
        scale: likewise.
        least: whether less of it is better.
    """
    ours = of(results, OURS)
    best, text = float("-inf"), "-"
    for name in results.peers:
        common = results.beside(name)
        peer, beside = of(common, name), of(common, OURS)
        if not peer.count:
            continue
        ahead = beside.mean - peer.mean if least else peer.mean - beside.mean
        if ahead > best:
            best, text = ahead, f"{name} {peer.text(digits, scale)}"
            if peer.count < ours.count:
                shown = beside.text(digits, scale)
                text += f" ({peer.count} of {ours.count}; ours on these {shown})"
    return text, best


def _above(found: float, bar: float, ahead: float) -> str:
    """The verdict where a bar is to be met and every peer beaten.

    Args:
        found: ours.
        bar: to be met.
        ahead: of ours is the best peer by so much.
    """
    verdict = at_least(found, bar)
    if ahead < 0.0:
        return verdict
    behind = "level with a peer" if ahead < LEVEL else f"{ahead:.3f} below a peer"
    return f"not met: {behind}" if verdict == "met" else f"{verdict}, {behind}"


def _f1_of(people: str, moment: str = WHOLE) -> Asked:
    return lambda results, name: results.f1(name, people, moment)


def _swapped(results: Results, name: str) -> Estimate:
    """Arcs and sines that are taken for each other."""
    return estimate(t.arc_sine for t in results.tallies(name, CALIBRATED, WHOLE))


def _calibrated(results: Results) -> list[Bar]:
    found, swapped = results.f1(OURS, CALIBRATED), _swapped(results, OURS)
    text, ahead = _best(results, _f1_of(CALIBRATED))
    return [
        Bar(
            "F1, calibrated people held out",
            f">= {CALIBRATED_F1}, above peers",
            found.text(),
            text,
            _above(found.mean, CALIBRATED_F1, ahead),
        ),
        Bar(
            "arcs and sines taken for each other, %",
            f"<= {100 * ARC_SINE:g}",
            swapped.text(1, 100),
            _best(results, _swapped, 1, 100, least=True)[0],
            at_most(100.0 * swapped.mean, 100.0 * ARC_SINE, 1),
        ),
    ]


def _families(results: Results) -> list[Bar]:
    rows: list[Bar] = []
    for family in results.families:
        found = results.f1(OURS, FAMILY + family)
        if not found.count:
            continue
        text, ahead = _best(results, _f1_of(FAMILY + family))
        verdict = _above(found.mean, FAMILY_F1, ahead)
        rows.append(
            Bar(
                f"F1, family left out: {family}",
                f">= {FAMILY_F1}, above peers",
                found.text(),
                text,
                verdict,
            )
        )
    met = sum(row.verdict == "met" for row in rows)
    every = "met" if met == len(rows) else f"not met: {met} of {len(rows)} families are"
    total = Bar(
        "F1, mean over families left out",
        "as each of them",
        results.of_families(OURS).text(),
        _best(results, Results.of_families)[0],
        every,
    )
    return [total, *rows] if rows else []


def _early(results: Results) -> list[Bar]:
    rows = []
    for moment, bar in EARLY_F1.items():
        found = results.f1(OURS, CALIBRATED, moment)
        text, ahead = _best(results, _f1_of(CALIBRATED, moment))
        rows.append(
            Bar(
                f"F1 after {moment}, calibrated people",
                f">= {bar:.2f}, above peers",
                found.text(),
                text,
                _above(found.mean, bar, ahead),
            )
        )
    return rows


def calibration(results: Results, model: str, people: str) -> Estimate:
    """Expected calibration error at all moments together, over seeds.

    Args:
        results: of the evaluation.
        model: a classifier with probabilities.
        people: how the names of the sets begin that are counted.
    """
    errors = []
    for result in results.judged[model].values():
        names = [name for name in result["sets"] if name.startswith(people)]
        error = pooled(result, names, tuple(MOMENTS)).calibration_error
        if error is not None:
            errors.append(error)
    return estimate(errors)


def _trust(results: Results) -> list[Bar]:
    rows = []
    for people, text in ((CALIBRATED, "calibrated people"), (FAMILY, "families left out")):
        error = calibration(results, OURS, people)
        rows.append(
            Bar(
                f"expected calibration error, {text}",
                f"<= {CALIBRATION_ERROR}",
                error.text(),
                "-",
                at_most(error.mean, CALIBRATION_ERROR),
            )
        )
    first = next(iter(MOMENTS))
    for moment, text in ((EVERYTHING, "all moments"), (first, f"after {first}")):
        auroc = results.nothing(EVERYTHING, moment, "auroc")
        rows.append(
            Bar(
                f"none against the four, AUROC, {text}",
                f">= {NONE_AUROC}",
                auroc.text(),
                "-",
                at_least(auroc.mean, NONE_AUROC),
            )
        )
    return rows


def _hover(results: Results) -> list[Bar]:
    """What those who only hold a place are bothered with."""
    rows = []
    for period in ("1.0", "0.1"):
        holds = [one["hover"][period] for one in results.judged[OURS].values() if "hover" in one]
        if not holds:
            continue
        people, asked, intents, given, different, bothered, shown_s = (
            sum(hold[key] for hold in holds)
            for key in (
                "people", "asked", "intents", "suggestions", "different", "bothered", "shown_s"
            )
        )  # fmt: skip
        seen = f"; {different} different, {shown_s:.0f} s on the screen" if given else ""
        rows.append(
            Bar(
                f"suggestions in 60 s of hover corrections, T = {float(period):g} s",
                "none",
                f"{given} of {asked} ({intents} intents{seen}); {bothered} of {people} people",
                "-",
                "met" if given == 0 else f"over by {given} in {people} min",
            )
        )
    return rows


def points_lost(results: Results, model: str, distortion: str) -> Estimate:
    """By how many points of F1 a distortion makes a classifier worse."""

    def lost(result: dict[str, Any]) -> float:
        changed = result["distorted"]
        before, after = (Tally.from_json(changed[name]).f1 for name in (UNCHANGED, distortion))
        return 100.0 * (before - after)

    return results.each(model, lost)


def _robust(results: Results) -> list[Bar]:
    first = next(iter(results.judged[OURS].values()))
    rows = []
    for name in (name for name in first["distorted"] if name != UNCHANGED):
        lost = points_lost(results, OURS, name)
        best, _ = _best(results, partial(points_lost, distortion=name), 1, least=True)
        rows.append(
            Bar(
                f"F1 lost with {name}",
                f"<= {ROBUST_POINTS:g} points",
                lost.text(1),
                best,
                at_most(lost.mean, ROBUST_POINTS, 1),
            )
        )
    return rows


def _adapted(results: Results) -> list[Bar]:
    """What five performances a primitive do for the person they are of, and cost the others."""
    people = [one for found in results.judged[OURS].values() for one in found.get("adapted", [])]
    if not people:
        return []

    def points(who: str, sign: float, kinds: tuple[str, ...]) -> Estimate:
        changed = [
            one[f"{who}_after"] - one[f"{who}_before"] for one in people if one["kind"] in kinds
        ]
        return estimate(100.0 * sign * change for change in changed)

    gained, noisy = (points("own", 1.0, (kind,)) for kind in ("odd", "clumsy"))
    lost = points("others", -1.0, ("odd", "clumsy"))
    return [
        Bar(
            f"F1 gained by 5 examples a class, {gained.count} people with odd ways",
            f">= {GAINED_POINTS:g} points",
            gained.text(1),
            "-",
            at_least(gained.mean, GAINED_POINTS, 1),
        ),
        Bar(
            f"likewise, {noisy.count} people of ordinary ways and twice the noise",
            "-",
            noisy.text(1),
            "-",
            "-",
        ),
        Bar(
            "F1 that others lose by it",
            f"<= {LOST_POINTS:g} points",
            lost.text(1),
            "-",
            at_most(lost.mean, LOST_POINTS, 1),
        ),
    ]


def _human(results: Results) -> list[Bar]:
    rows = []
    for human in HUMAN_SETS:
        seeds = results.human.get(human.name)
        if not seeds:
            continue
        found = estimate(seed["ours"] for seed in seeds.values())
        peer = max(
            (estimate(seed[kind] for seed in seeds.values()) for kind in ("padded", "stretched")),
            key=lambda one: one.mean,
        )
        published = human.published.recurrent
        bar = max(peer.mean, published or 0.0)
        rows.append(
            Bar(
                f"people: {human.name}, accuracy",
                f">= {bar:.3f}: " + ("published" if bar == published else "MiniRocket"),
                found.text(),
                f"MiniRocket {peer.text()}",
                at_least(found.mean, bar),
            )
        )
    return rows


def _speed(results: Results) -> list[Bar]:
    if not results.latency:
        return []
    rows = []
    for name, key, bar in (("p50", "p50_s", P50_S), ("p99", "p99_s", P99_S)):
        found = results.latency[key]
        rows.append(
            Bar(
                f"one window of {WINDOW_S:g} s, one thread, {name}, ms",
                f"<= {bar * 1e3:g}",
                f"{found * 1e3:.2f}",
                "-",
                at_most(found * 1e3, bar * 1e3, 2),
            )
        )
    return rows


def bars(results: Results) -> list[Bar]:
    """Every demand in order; only those on people if our network has not been run."""
    rows: list[Bar] = []
    if OURS in results.judged:
        for part in (_calibrated, _families, _early, _trust, _hover, _robust, _adapted):
            rows += part(results)
    return rows + _human(results) + _speed(results)
