"""What is kept is not found again; what a changed code, people or question makes stale is."""

from pathlib import Path
from typing import Any

import pytest

from cli.main import main
from common.clock import ManualClock
from training.evaluation import run
from training.evaluation.contenders import CODE
from training.evaluation.folds import SIZES
from training.evaluation.human import HUMAN_SETS, SHOULDER, HumanSet
from training.evaluation.latency import Latency
from training.evaluation.marks import Marks
from training.evaluation.names import OURS, WHOLE
from training.evaluation.ours import Ours
from training.evaluation.report import BEGIN, tables_of
from training.evaluation.run import Evaluation, Order
from training.evaluation.sources import ROOT, code_of
from training.evaluation.tables import Table


def test_comments_docstrings_and_formatting_are_no_change_of_code(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("training.evaluation.sources.ROOT", tmp_path)
    path = tmp_path / "one.py"

    def hashed(text: str) -> str:
        path.write_text(text)
        code_of.cache_clear()
        return code_of("*.py")

    plain = hashed("LIMIT = 3\ndef f(x):\n    return x + LIMIT\n")
    assert plain == hashed(
        '"""What it is."""\nLIMIT = 3\n"""Why."""\n\ndef f(x):\n    """Adds."""\n    return (x\n'
        "        + LIMIT)  # so much\n"
    )
    assert plain != hashed("LIMIT = 4\ndef f(x):\n    return x + LIMIT\n")
    assert plain != hashed("LIMIT = 3\ndef f(x):\n    return x - LIMIT\n")
    code_of.cache_clear()
    with pytest.raises(FileNotFoundError, match=r"two\.py: no such source file"):
        code_of("two.py")
    code_of.cache_clear()


def test_every_classifier_names_source_files_that_are_there() -> None:
    assert all((ROOT / path).is_file() for paths in CODE.values() for path in paths)


def marks_of(size: str = "full") -> dict[str, str]:
    """By what is marked: two classifiers, and what ours is asked besides."""
    code_of.cache_clear()
    marks = Marks(SIZES[size])
    besides = {"hover": marks.hover(), "adapted": marks.adaptation(), "machine": marks.machine()}
    return {name: marks.classifier(name) for name in (OURS, "svm")} | besides


@pytest.fixture(scope="module")
def before() -> dict[str, str]:
    return marks_of()


def test_marks_tell_sizes_classifiers_and_questions_apart(before: dict[str, str]) -> None:
    marks = [*before.values(), *marks_of("quick").values()]
    assert len(set(marks)) == len(marks)


@pytest.mark.parametrize(
    ("changed", "to"),
    [
        ("training.evaluation.judging.DISTORTED", 100),
        ("training.evaluation.judging.MOMENTS", {"1.0 s": 1.2, WHOLE: None}),
        ("training.scores.CALIBRATION_BINS", 10),
    ],
)
def test_another_question_makes_what_every_classifier_answered_stale(
    changed: str, to: object, before: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(changed, to)
    after = marks_of()
    stale = {name for name in before if before[name] != after[name]}
    assert stale == set(before) - {"machine"}


@pytest.mark.parametrize(
    ("file", "stale"),
    [
        ("training/evaluation/rejection.py", {OURS, "hover", "adapted"}),
        ("training/evaluation/judging.py", {"hover", "adapted"}),
        ("training/evaluation/unusual.py", {"adapted"}),
        ("training/evaluation/hover.py", {"hover"}),
        ("training/svm.py", {"svm", "machine"}),
    ],
)
def test_another_source_file_makes_stale_what_follows_from_it(
    file: str, stale: set[str], before: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    read = Path.read_text

    def edited(path: Path) -> str:
        return read(path) + ("MORE = 1\n" if path == ROOT / file else "")

    monkeypatch.setattr(Path, "read_text", edited)
    after = marks_of()
    assert {name for name in before if before[name] != after[name]} == stale


class Asked:
    """Counts what would be trained and asked, without doing it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.done: list[str] = []
        self.code = "1"
        self.hover_code = "1"
        self.stops_while: str | None = None

        def answers(kind: str, result: Any) -> Any:
            def answer(first: Any, *_rest: Any) -> Any:
                name = getattr(first, "name", "")
                if self.stops_while == kind:
                    raise KeyboardInterrupt
                self.done.append(f"{kind} {name}".strip())
                return result

            return answer

        monkeypatch.setattr(run, "fold", answers("people", "a fold"))
        monkeypatch.setattr(run, "judge", answers("judge", {"fit_s": 1.0}))
        monkeypatch.setattr(run, "hovered", lambda *_: answers("hover", {"1.0": {}})(None))
        monkeypatch.setattr(
            run, "adapted", lambda *_: answers("adapt", [{"own_before": 0.5}])(None)
        )
        monkeypatch.setattr(run, "judge_human", lambda one, *_: answers("human", {"n": 1.0})(one))
        monkeypatch.setattr(run, "machine_f1", lambda *_: 0.8)
        monkeypatch.setattr(run, "OnnxModel", lambda path: None)
        monkeypatch.setattr(run, "latency", lambda *_: Latency(1e-4, 2e-4, 9))
        monkeypatch.setattr(run, "of_recordings", lambda: "recordings")
        monkeypatch.setattr(run, "Marks", lambda size: self)
        monkeypatch.setattr(Ours, "save", lambda _, path: self.write(path))
        monkeypatch.setattr(
            Ours, "load", lambda _, path: path.with_suffix(".pt").read_text() and None
        )

    @staticmethod
    def write(path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("graph")
        path.with_suffix(".pt").write_text("weights")

    def classifier(self, name: str) -> str:
        return f"{name} {self.code if name == OURS else 1}"

    def hover(self) -> str:
        return f"{self.classifier(OURS)} {self.hover_code}"

    def adaptation(self) -> str:
        return self.classifier(OURS)

    def machine(self) -> str:
        return "machine"

    def run(self, out: Path, models: tuple[str, ...] = (OURS, "svm"), **order: Any) -> list[str]:
        """What had to be done."""
        self.done = []
        Evaluation(Order(out, (0,), models, people=False, **order), ManualClock(), quiet).find()
        return self.done


def quiet(_text: str, _done: int, _of: int) -> None:
    pass


@pytest.fixture
def asked(monkeypatch) -> Asked:
    return Asked(monkeypatch)


def results_of(out: Path) -> run.Results:
    return Evaluation(Order(out, models=()), ManualClock(), quiet).results()


def test_what_is_kept_is_not_found_again(asked: Asked, tmp_path: Path) -> None:
    assert asked.run(tmp_path) == ["people", f"judge {OURS}", "hover", "adapt", "judge svm"]
    assert asked.run(tmp_path) == []
    found = results_of(tmp_path).judged
    assert {"hover", "adapted"} <= set(found[OURS][0])
    assert list(found) == [OURS, "svm"]


def test_changed_code_of_a_classifier_makes_its_results_stale_alone(
    asked: Asked, tmp_path: Path
) -> None:
    asked.run(tmp_path)
    asked.code = "2"
    assert list(results_of(tmp_path).judged) == ["svm"]
    assert asked.run(tmp_path) == ["people", f"judge {OURS}", "hover", "adapt"]


def test_changed_services_ask_again_what_hovering_people_see_and_train_nothing(
    asked: Asked, tmp_path: Path
) -> None:
    asked.run(tmp_path)
    asked.hover_code = "2"
    assert "hover" not in results_of(tmp_path).judged[OURS][0]
    assert asked.run(tmp_path) == ["hover"]


def test_stopped_while_people_adapt_it_goes_on_there(asked: Asked, tmp_path: Path) -> None:
    asked.stops_while = "adapt"
    with pytest.raises(KeyboardInterrupt):
        asked.run(tmp_path)
    assert "adapted" not in results_of(tmp_path).judged[OURS][0]
    asked.stops_while = None
    assert asked.run(tmp_path) == ["people", "adapt", "judge svm"]


def test_lost_weights_are_trained_anew(asked: Asked, tmp_path: Path) -> None:
    asked.run(tmp_path)
    (tmp_path / "models" / f"{OURS}-0.pt").unlink()
    assert asked.run(tmp_path) == ["people", f"judge {OURS}"]


def test_a_quick_run_in_the_same_folder_writes_over_nothing(
    asked: Asked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = Table("Bars", "n = 1", ("question", "verdict"), (("F1", "met"),))
    monkeypatch.setattr("training.evaluation.report.tables_of", lambda _: [table])
    monkeypatch.setattr("training.evaluation.report.draw", drawn)
    arguments = ["evaluate", "--out", str(tmp_path), "--models", f"{OURS},svm", "--no-people"]
    assert main([*arguments, "--seeds", "0"]) == 0
    kept = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    table = Table("Bars", "n = 1", ("question", "verdict"), (("F1", "short by 0.1"),))
    asked.done = []
    assert main([*arguments, "--quick"]) == 0
    assert f"judge {OURS}" in asked.done
    assert {path: path.read_bytes() for path in kept} == kept
    assert "short by" in (tmp_path / "quick" / "report.md").read_text()


def test_a_missing_library_is_told_and_the_others_go_on(
    asked: Asked, tmp_path: Path, monkeypatch
) -> None:
    def contender(name: str) -> Any:
        if name == "svm":
            raise ModuleNotFoundError(name="sklearn")
        return Ours()

    monkeypatch.setattr(run, "contender", contender)
    evaluation = Evaluation(
        Order(tmp_path, (0,), ("svm", OURS), people=False), ManualClock(), quiet
    )
    evaluation.find()
    assert f"judge {OURS}" in asked.done
    assert evaluation.results().not_run["svm"] == (
        "sklearn is not installed; make evaluate installs it"
    )


def test_a_row_of_people_says_which_library_it_lacks(
    asked: Asked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def judge_human(one: HumanSet, *_: Any) -> dict[str, float]:
        if one.name == SHOULDER:
            raise ModuleNotFoundError(name="seglearn")
        return {"ours": 0.9, "padded": 0.8, "stretched": 0.7, "n": 9.0}

    monkeypatch.setattr(run, "import_module", lambda _: None)
    monkeypatch.setattr(run, "judge_human", judge_human)
    evaluation = Evaluation(Order(tmp_path, (0,), ()), ManualClock(), quiet)
    evaluation.find()
    rows = {row[0]: row[1] for row in tables_of(evaluation.results())[-1].rows}
    assert len(rows) == len(HUMAN_SETS)
    assert rows.pop(SHOULDER) == "not run: seglearn is not installed; make evaluate installs it"
    assert set(rows.values()) == {"9"}

    def missing(name: str) -> None:
        raise ModuleNotFoundError(name=name)

    monkeypatch.setattr(run, "import_module", missing)
    evaluation = Evaluation(Order(tmp_path / "other", (0,), ()), ManualClock(), quiet)
    evaluation.find()
    rows = {row[0]: row[1] for row in tables_of(evaluation.results())[-1].rows}
    told = "not run: aeon is not installed; make evaluate installs it"
    assert rows == dict.fromkeys((one.name for one in HUMAN_SETS), told)


def test_the_command_reports_without_training_and_renews_a_page(
    asked: Asked, tmp_path: Path, monkeypatch, capsys
) -> None:
    asked.run(tmp_path / "e")
    asked.done = []
    table = Table("Bars", "n = 1", ("question", "verdict"), (("F1", "met"),))
    monkeypatch.setattr("training.evaluation.report.tables_of", lambda _: [table])
    monkeypatch.setattr("training.evaluation.report.draw", drawn)
    page = tmp_path / "evaluation.md"
    page.write_text("# Evaluation\n\nText.\n")
    arguments = ["evaluate", "--report", "--out", str(tmp_path / "e"), "--docs", str(page)]
    assert main(arguments) == 2
    assert "lacks the line" in capsys.readouterr().err
    page.write_text(f"# Evaluation\n\nText.\n\n{BEGIN}\nold\n")
    assert main(arguments) == 0
    assert main(arguments) == 0
    assert asked.done == []
    assert page.read_text() == (
        f"# Evaluation\n\nText.\n\n{BEGIN}\n\n## Bars\n\n"
        "| question | verdict |\n| --- | --- |\n| F1 | met |\n\nn = 1\n\n"
        "## Figures\n\n![A line.](figures/evaluation-early.png)\n\nA line.\n"
    )
    assert (tmp_path / "figures" / "evaluation-early.png").read_bytes() == b"early.png"


def drawn(_results: run.Results, _table: Table, out: Path) -> list[tuple[str, str]]:
    for name in ("bars.png", "early.png"):
        (out / name).write_bytes(name.encode())
    return [("bars.png", "Bars."), ("early.png", "A line.")]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--seeds", "0,7"], "--seeds 7: use 0 to 4"),
        (["--quick", "--docs", "README.md"], "figures of a quick run mean nothing"),
        (["--docs", "nowhere.md"], "nowhere.md: no such file"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    arguments: list[str], complaint: str, tmp_path: Path, capsys
) -> None:
    try:
        code = main(["evaluate", "--out", str(tmp_path), *arguments])
    except SystemExit as leaving:
        code = leaving.code
    assert code == 2
    assert complaint in capsys.readouterr().err
