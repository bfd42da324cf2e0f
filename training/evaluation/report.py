"""The report: tables of everything, as Markdown, HTML and a picture, with its figures."""

from collections.abc import Sequence
from pathlib import Path

from training.evaluation.bars import bars, calibration, points_lost
from training.evaluation.distortions import UNCHANGED
from training.evaluation.figures import draw
from training.evaluation.human import HUMAN_SETS
from training.evaluation.measures import Tally, estimate
from training.evaluation.names import CALIBRATED, FAMILY, KNOWN, MOMENTS, WHOLE
from training.evaluation.results import Results
from training.evaluation.tables import Table

STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:75em;margin:2em auto;padding:0 1em}
table{border-collapse:collapse}
td,th{padding:.25em .8em;border-bottom:1px solid #ddd;text-align:left}
.met{color:#006b4f;font-weight:600}.short{color:#a33c00;font-weight:600}img{max-width:100%}"""


def _numbers(results: Results) -> str:
    """What was counted, for captions."""
    seeds = max((len(found) for found in results.judged.values()), default=0)
    return f"{seeds} seeds; mean ± 95 % interval over seeds (Student)"


def _bars(results: Results) -> Table:
    rows = tuple((b.question, b.bar, b.found, b.peer, b.verdict) for b in bars(results))
    return Table(
        "Against the bars",
        f"{_numbers(results)}. A family is left out in one seed, so its F1 has no interval.",
        ("question", "bar", "ours", "best peer", "verdict"),
        rows,
    )


def _classifiers(results: Results) -> Table:
    rows: list[tuple[str, ...]] = []
    for name in results.models:
        error = calibration(results, name, CALIBRATED)
        swapped = estimate(t.arc_sine for t in results.tallies(name, CALIBRATED, WHOLE))
        rows.append(
            (
                name,
                str(len(results.judged[name])),
                results.f1(name, CALIBRATED).text(),
                f"{swapped.text(1, 100)} %",
                results.f1(name, KNOWN).text(),
                results.of_families(name).text(),
                error.text() if error.count else "-",
                f"{results.each(name, lambda result: result['fit_s']).mean:.0f} s",
            )
        )
    rows += [(name, f"not run: {why}", *["-"] * 6) for name, why in results.not_run.items()]
    count = results.count(CALIBRATED) if results.models else 0
    own = (
        " The thesis' machine on its own task (794 vectors of line, arc and sine, random 80/20"
        f" split, {len(results.own_split)} sets) scores F1 {estimate(results.own_split).text()};"
        " in the thesis 0.796."
        if results.own_split
        else ""
    )
    return Table(
        "Classifiers, at the end of a primitive",
        f"Weighted F1. {_numbers(results)}; calibrated people: {count} primitives in all;"
        " left out: each family is one value. ECE: over all moments." + own,
        (
            "classifier",
            "seeds",
            CALIBRATED,
            "arc <-> sine",
            "wide, families known",
            "wide, family left out",
            "ECE",
            "trains in",
        ),
        tuple(rows),
    )


def _families(results: Results) -> Table:
    rows = []
    for family in results.families:
        name = FAMILY + family
        count = results.count(name)
        scores = (results.f1(model, name).text() for model in results.models)
        rows.append((family, str(count), *scores))
    rows.append(("mean", "", *(results.of_families(model).text() for model in results.models)))
    return Table(
        "Each family left out",
        "Weighted F1 at the end, of people of a kind that nobody in the training is of. n:"
        " primitives.",
        ("family", "n", *results.models),
        tuple(rows),
    )


def _early(results: Results) -> Table:
    rows = []
    for model in results.models:
        for people, text in ((CALIBRATED, "calibrated"), (FAMILY, "family left out")):
            scores = (
                (
                    results.f1(model, people, moment)
                    if people == CALIBRATED
                    else results.of_families(model, moment)
                ).text()
                for moment in MOMENTS
            )
            rows.append((model, text, *scores))
    return Table(
        "So long after a motion began",
        f"Weighted F1. {_numbers(results)}, or over families.",
        ("classifier", "people", *MOMENTS),
        tuple(rows),
    )


def _robust(results: Results) -> Table:
    first = next(iter(next(iter(results.judged.values())).values()))
    names = tuple(name for name in first["distorted"] if name != UNCHANGED)
    count = Tally.from_json(first["distorted"][UNCHANGED]).count
    rows = tuple(
        (model, *(points_lost(results, model, name).text(1) for name in names))
        for model in results.models
    )
    return Table(
        "Other pads, links and hands",
        f"Points of weighted F1 lost at the end, calibrated people, {count} primitives a seed."
        f" {_numbers(results)}.",
        ("classifier", *names),
        rows,
    )


def _human(results: Results) -> Table:
    rows = []
    for human in HUMAN_SETS:
        seeds = results.human.get(human.name)
        if not seeds:
            continue
        ours, padded, stretched = (
            estimate(seed[kind] for seed in seeds.values()).text()
            for kind in ("ours", "padded", "stretched")
        )
        recurrent = human.published.recurrent
        rows.append(
            (
                human.name,
                str(int(next(iter(seeds.values()))["n"])),
                ours,
                padded,
                stretched,
                "-" if recurrent is None else f"{recurrent:.3f}",
                f"{human.published.best:.3f}",
                human.published.source,
            )
        )
    count = max((len(seeds) for seeds in results.human.values()), default=0)
    return Table(
        "Real people",
        f"Accuracy on the official test split, {count} seeds, mean ± 95 % interval; shoulder"
        " exercises: five folds of two subjects each, so the interval is over people. n: test"
        " series (of the first fold). One network, no ensemble; the same recipe on all.",
        (
            "data set",
            "n",
            "ours",
            "MiniRocket, padded",
            "MiniRocket, stretched",
            "published recurrent",
            "published best",
            "source",
        ),
        tuple(rows),
    )


def tables_of(results: Results) -> list[Table]:
    """Every table there are results for."""
    tables = [_bars(results)]
    if results.judged:
        tables += [_classifiers(results), _early(results), _robust(results)]
        if results.families:
            tables.insert(2, _families(results))
    if results.human:
        tables.append(_human(results))
    return tables


def write(results: Results, out: Path) -> list[Table]:
    """Write report.md, report.html and all figures into a folder; returns the tables."""
    out.mkdir(parents=True, exist_ok=True)
    tables = tables_of(results)
    figures = draw(results, tables[0], out)
    text = "\n".join(table.markdown() for table in tables)
    pictures = "\n".join(f"![{caption}]({name})\n\n{caption}\n" for name, caption in figures)
    (out / "report.md").write_text(f"# Evaluation\n\n{text}\n## Figures\n\n{pictures}")
    (out / "report.html").write_text(_page(tables, figures))
    return tables


def _page(tables: Sequence[Table], figures: Sequence[tuple[str, str]]) -> str:
    body = "".join(table.html() for table in tables)
    pictures = "".join(
        f'<figure><img src="{name}" alt=""><figcaption>{caption}</figcaption></figure>'
        for name, caption in figures
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Evaluation</title>'
        f"<style>{STYLE}</style><h1>Evaluation</h1>{body}<h2>Figures</h2>{pictures}</html>\n"
    )
