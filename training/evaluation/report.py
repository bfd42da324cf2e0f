"""The report: tables of everything, as Markdown, HTML and a picture, with its figures."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from training.evaluation.bars import bars, calibration, points_lost
from training.evaluation.distortions import UNCHANGED
from training.evaluation.figures import PICTURE_OF_BARS, Drawn, draw
from training.evaluation.human import HUMAN_SETS
from training.evaluation.measures import Tally, estimate
from training.evaluation.names import (
    CALIBRATED,
    EVERYTHING,
    FAMILY,
    KNOWN,
    MOMENTS,
    OURS,
    WHOLE,
)
from training.evaluation.results import Results
from training.evaluation.tables import Table

BEGIN = "<!-- made by 'autocomplete evaluate --docs': what follows is not to be edited -->"
STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:75em;margin:2em auto;padding:0 1em}
table{border-collapse:collapse}
td,th{padding:.25em .8em;border-bottom:1px solid #ddd;text-align:left}
.met{color:#006b4f;font-weight:600}.short{color:#a33c00;font-weight:600}img{max-width:100%}"""


def _numbers(results: Results, model: str | None = None) -> str:
    """What was counted, for captions: of one classifier, or of that with most seeds."""
    counts = {name: len(found) for name, found in results.judged.items()}
    seeds = max(counts.values(), default=0) if model is None else counts.get(model, 0)
    return f"{seeds} {'seed' if seeds == 1 else 'seeds'}; mean ± 95 % interval over seeds (Student)"


def _bars(results: Results) -> Table:
    rows = tuple((b.question, b.bar, b.found, b.peer, b.verdict) for b in bars(results))
    return Table(
        "Against the bars",
        f"Ours: {_numbers(results, OURS)}. A family is left out in one seed: no interval."
        " Intervals of adaptation and of the mean over families are over people and families."
        " A peer that lacks seeds is compared with ours on those it has: how many, in brackets.",
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
        " left out: each family is one value. ECE: over all moments. Trains in: by the clock, on a"
        " core that other work may have shared." + own,
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
        ("family", "n", *(results.titled(model) for model in results.models)),
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
            rows.append((results.titled(model), text, *scores))
    return Table(
        "So long after a motion began",
        f"Weighted F1. {_numbers(results)}, or over families.",
        ("classifier", "people", *MOMENTS),
        tuple(rows),
    )


def _flown(results: Results) -> Table:
    """What the early table leaves out: only sure answers fly."""
    rows = []
    for people, text in ((CALIBRATED, "calibrated"), (FAMILY, "family left out")):
        found = [results.answered(people, moment) for moment in MOMENTS]
        rows.append((f"{text}: answered", *(some.text(1, 100) for some, _ in found)))
        rows.append((f"{text}: right when answered", *(right.text(1, 100) for _, right in found)))
    first = next(iter(results.judged[OURS].values()))
    for kind in first["none"]:
        shares = (results.nothing(kind, moment, "answered") for moment in MOMENTS)
        rows.append((f"nothing, {kind}: answered", *(share.text(1, 100) for share in shares)))
    return Table(
        "What flies: only answers that are sure enough",
        f"Ours, % of windows, with the threshold of each seed's model. {_numbers(results, OURS)},"
        " or over families. Whatever is answered to nothing is wrong. In flight most rests and"
        " turns on the spot never reach the model: nothing has moved yet.",
        ("windows", *MOMENTS),
        tuple(rows),
    )


def _nothing(results: Results) -> Table:
    first = next(iter(results.judged[OURS].values()))["none"]
    rows = tuple(
        (
            kind,
            f"{moments[WHOLE]['n']:.0f}",
            *(results.nothing(kind, moment, "auroc").text() for moment in (*MOMENTS, EVERYTHING)),
        )
        for kind, moments in first.items()
    )
    return Table(
        "None against the four",
        "Area under the curve of `meant`, ours, against primitives of as many seconds by people of"
        f" families that are known. n: performances of nothing a seed."
        f" {_numbers(results, OURS)}.",
        ("kind of nothing", "n", *MOMENTS, "all moments"),
        rows,
    )


def _robust(results: Results) -> Table:
    first = next(iter(next(iter(results.judged.values())).values()))
    names = tuple(name for name in first["distorted"] if name != UNCHANGED)
    count = Tally.from_json(first["distorted"][UNCHANGED]).count
    rows = tuple(
        (results.titled(model), *(points_lost(results, model, name).text(1) for name in names))
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
    rows: list[tuple[str, ...]] = []
    count = max((len(seeds) for seeds in results.human.values()), default=0)
    for human in HUMAN_SETS:
        seeds = results.human.get(human.name)
        if not seeds:
            why = results.human_not_run.get(human.name, "not asked for yet")
            rows.append((human.name, f"not run: {why}", *["-"] * 6))
            continue
        part = "" if len(seeds) == count else f" ({len(seeds)} of {count} seeds)"
        ours, padded, stretched = (
            estimate(seed[kind] for seed in seeds.values()).text()
            for kind in ("ours", "padded", "stretched")
        )
        recurrent = human.published.recurrent
        rows.append(
            (
                human.name + part,
                str(int(next(iter(seeds.values()))["n"])),
                ours,
                padded,
                stretched,
                "-" if recurrent is None else f"{recurrent:.3f}",
                f"{human.published.best:.3f}",
                human.published.source,
            )
        )
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
        tables.append(_classifiers(results))
        if results.families:
            tables.append(_families(results))
        tables.append(_early(results))
        if OURS in results.models:
            tables += [_flown(results), _nothing(results)]
        tables.append(_robust(results))
    if results.human or results.human_not_run:
        tables.append(_human(results))
    return tables


def write(results: Results, out: Path, page: Path | None = None) -> list[Table]:
    """Write report.md, report.html and all figures into a folder.

    Args:
        results: to report.
        out: the folder.
        page: a page of text whose end, after the line `BEGIN`, becomes these tables and figures.

    Returns:
        The tables.

    Raises:
        ValueError: if the page lacks that line.
    """
    out.mkdir(parents=True, exist_ok=True)
    tables = tables_of(results)
    figures = draw(results, tables[0], out)
    (out / "report.md").write_text(f"# Evaluation\n\n{_markdown(tables, figures)}")
    (out / "report.html").write_text(_html(tables, figures))
    if page is not None:
        _renew(page, tables, figures, out)
    return tables


def _markdown(tables: Sequence[Table], figures: Sequence[Drawn]) -> str:
    text = "\n".join(table.markdown() for table in tables)
    pictures = "\n".join(f"![{caption}]({name})\n\n{caption}\n" for name, caption in figures)
    return f"{text}\n## Figures\n\n{pictures}"


def _html(tables: Sequence[Table], figures: Sequence[Drawn]) -> str:
    body = "".join(table.html() for table in tables)
    pictures = "".join(
        f'<figure><img src="{name}" alt=""><figcaption>{caption}</figcaption></figure>'
        for name, caption in figures
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Evaluation</title>'
        f"<style>{STYLE}</style><h1>Evaluation</h1>{body}<h2>Figures</h2>{pictures}</html>\n"
    )


def _renew(page: Path, tables: Sequence[Table], figures: Sequence[Drawn], out: Path) -> None:
    """Write the end of a page; its figures go to `figures/` beside it, named for the page."""
    before, begin, _ = page.read_text().partition(BEGIN)
    if not begin:
        raise ValueError(f"{page} lacks the line {BEGIN!r}; put it where tables and figures go")
    folder = page.parent / "figures"
    folder.mkdir(exist_ok=True)
    shown = []
    for name, caption in figures:
        if name != PICTURE_OF_BARS:  # the page has them as a table
            copied = folder / f"{page.stem}-{name}"
            shutil.copyfile(out / name, copied)
            shown.append((f"figures/{copied.name}", caption))
    page.write_text(f"{before}{BEGIN}\n\n{_markdown(tables, shown)}")
