import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from cli.main import main
from services.classifier.model import OnnxModel
from training import train as training
from training.dataset.primitive import Primitive
from training.fit import Budget, Epoch
from training.labels import PRIMITIVES
from training.outcome import Preset
from training.people import Share, people_of
from training.train import train

TINY = Preset(
    training=Share(wide_people=12, wide=0.03, thesis_people=6, thesis=0.02),
    validation=Share(wide_people=6, wide=0.02, thesis_people=4, thesis=0.02),
    test=Share(wide_people=12, wide=0.03, thesis_people=4, thesis=0.02),
    budget=Budget(windows=450),
)


class Told:
    """Remembers how far a run said it was."""

    def __init__(self) -> None:
        self.sets: dict[str, tuple[int, int]] = {}
        self.epochs: list[Epoch] = []
        self.batches: list[tuple[int, int]] = []

    def generating(self, name: str, done: int, total: int) -> None:
        assert self.sets.get(name, (0, 0))[0] <= done <= total
        self.sets[name] = (done, total)

    def batch(self, done: int, total: int) -> None:
        self.batches.append((done, total))

    def epoch(self, epoch: Epoch, epochs: int) -> None:
        assert epoch.number <= epochs
        self.epochs.append(epoch)


@pytest.fixture(autouse=True)
def _tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(training.PRESETS, "quick", TINY)


class Stopped(Told):
    """Loses its patience after an epoch."""

    def epoch(self, epoch: Epoch, epochs: int) -> None:
        super().epoch(epoch, epochs)
        if epoch.number == 2:
            raise KeyboardInterrupt


def test_a_run_leaves_a_model_its_card_and_its_figures(tmp_path: Path) -> None:
    told = Told()
    run = train("quick", 7, tmp_path, told)
    left = sorted(p.name for p in tmp_path.iterdir())
    assert left == ["README.md", "intent.json", "intent.onnx", "intent.pt"]
    model = OnnxModel(tmp_path / "intent.onnx")
    assert model.name == f"intent-{run.sha256[:8]}"
    assert model.labels == PRIMITIVES
    assert run.parity < 1e-5
    card = (tmp_path / "README.md").read_text()
    assert run.sha256 in card
    figures = json.loads((tmp_path / "intent.json").read_text())
    assert set(figures["sets"]) == {"calibrated", "wide"}
    for found in figures["sets"].values():
        assert f"{found['f1']:.3f}" in card
        assert sum(map(sum, found["confusion"])) == found["count"]
        assert list(found["early_f1"]) == ["1.0", "1.5", "2.0", "3.0"]
    assert [epoch["number"] for epoch in figures["history"]] == [1, 2, 3]
    assert all(done == total for done, total in told.sets.values())
    assert set(told.sets) == {"training", "validation", "test"}
    assert len(told.epochs) == 3
    assert told.batches[-1][0] == told.batches[-1][1]


def test_the_same_seed_gives_the_same_file_stopped_and_resumed_or_not(tmp_path: Path) -> None:
    one = train("quick", 3, tmp_path / "one", Told())
    other = train("quick", 3, tmp_path / "other", Told())
    with pytest.raises(KeyboardInterrupt):
        train("quick", 3, tmp_path / "stopped", Stopped())
    resumed = train("quick", 3, tmp_path / "stopped", told := Told(), resume=True)
    assert [epoch.number for epoch in told.epochs] == [2, 3]
    different = train("quick", 4, tmp_path / "different", Told())
    assert one.sha256 == other.sha256 == resumed.sha256 != different.sha256


def test_a_run_that_is_stopped_has_failed_and_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "train", stopped)
    assert main(["train", "--preset", "quick", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        "autocomplete train: stopped; --resume goes on after the last whole epoch\n"
    )


def test_a_run_goes_on_with_the_people_it_began_with_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(KeyboardInterrupt):
        train("quick", 3, tmp_path, Stopped())

    def softer(*arguments: Any) -> list[Primitive]:
        return [replace(one, sticks=0.9 * one.sticks) for one in people_of(*arguments)]

    monkeypatch.setattr(training, "people_of", softer)
    resumed = ["train", "--preset", "quick", "--seed", "3", "--resume", "--out", str(tmp_path)]
    assert main(resumed) == 1
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert "seed 3, people " in error
    assert "run without --resume to begin anew" in error


def test_people_are_the_same_in_any_number_of_processes() -> None:
    share = Share(wide_people=30, wide=0.06, thesis_people=3, thesis=0.01)
    one, other = people_of("set", share, 5), people_of("set", share, 5, processes=2)
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert (a.label, a.operator) == (b.label, b.operator)
        assert (a.sticks == b.sticks).all()
    assert len({a.operator for a in one}) == share.people


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "there is no"),
        (b"nonsense", "cannot be read"),
        ({"weights": 1}, "is none; run without --resume"),
    ],
)
def test_what_cannot_be_resumed_is_one_line(
    content: bytes | dict[str, object] | None,
    reason: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if isinstance(content, dict):
        torch.save(content, tmp_path / "intent.checkpoint")
    elif content is not None:
        (tmp_path / "intent.checkpoint").write_bytes(content)
    assert main(["train", "--preset", "quick", "--resume", "--out", str(tmp_path)]) == 1
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert reason in error


def test_the_command_prints_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--preset", "quick", "--seed", "1", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    for word in ("calibrated", "wide", "1.5 s", "AUROC", "helix"):
        assert word in printed
    assert (tmp_path / "intent.onnx").exists()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--finetune", "ana.npz", "--preset", "quick"], "--preset"),
        (["--finetune", "ana.npz", "--ablation", "page.md"], "--ablation"),
        (["--finetune", "ana.npz", "--resume"], "--resume goes on with a training"),
        (["--ablation", "page.md", "--preset", "shipped"], "--preset"),
        (["--ablation", "page.md", "--resume"], "--resume goes on with a training"),
        (["--ablation", "page.md", "--seed", "0"], "--ablation has seeds of its own"),
        (["--ablation", "page.md", "--out", "models"], "--ablation writes its page only"),
        (["--model", "intent.onnx"], "name a file with --finetune"),
        (["--operator", "ana"], "name a file with --finetune"),
    ],
)
def test_what_would_be_ignored_is_refused(
    arguments: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code: object = main(["train", *arguments])
    except SystemExit as left:
        code = left.code
    error = capsys.readouterr().err
    assert code == 2
    assert len(error.splitlines()) == 1
    assert reason in error


@pytest.mark.parametrize(
    "arguments",
    [
        ["--preset", "huge"],
        ["--seed", "-1"],
        ["--seed", "x"],
        ["--rate", "1"],
        ["--out", __file__],
        ["--finetune", "ana.npz", "--out", __file__],
    ],
)
def test_wrong_usage_is_one_line_and_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(["train", *arguments])
    assert left.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
