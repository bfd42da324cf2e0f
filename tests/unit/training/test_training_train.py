import json
from pathlib import Path

import pytest

from cli.main import main
from services.classifier.model import OnnxModel
from training import train as training
from training.fit import Epoch
from training.labels import PRIMITIVES
from training.train import Preset, train

TINY = Preset(
    operators=10,
    multiple=0.04,
    epochs=2,
    validation_operators=10,
    validation_multiple=0.03,
    test_operators=10,
    test_multiple=0.04,
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


def test_a_run_leaves_a_model_its_card_and_its_figures(tmp_path: Path) -> None:
    told = Told()
    run = train("quick", 7, tmp_path, told)
    model = OnnxModel(tmp_path / "intent.onnx")
    assert model.name == f"intent-{run.sha256[:8]}"
    assert model.labels == PRIMITIVES
    assert run.parity < 1e-5
    card = (tmp_path / "README.md").read_text()
    assert run.sha256 in card
    assert "SVM (thesis)" in card
    figures = json.loads((tmp_path / "intent.json").read_text())
    ours = figures["classifiers"]["CNN-GRU"]
    assert f"{ours['f1']:.3f}" in card
    assert sum(map(sum, ours["confusion"])) == ours["count"]
    assert list(ours["early_f1"]) == ["1.0", "1.5", "2.0", "3.0"]
    assert all(done == total for done, total in told.sets.values())
    assert set(told.sets) == {"training", "validation", "test"}
    assert len(told.epochs) == 2
    assert told.batches[-1][0] == told.batches[-1][1]


def test_the_same_seed_gives_the_same_file(tmp_path: Path) -> None:
    one = train("quick", 3, tmp_path / "one", Told())
    other = train("quick", 3, tmp_path / "other", Told())
    different = train("quick", 4, tmp_path / "different", Told())
    assert one.sha256 == other.sha256 != different.sha256


def test_the_command_prints_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--preset", "quick", "--seed", "1", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    for word in ("CNN-GRU", "SVM (thesis)", "interval", "1.5 s", "helix"):
        assert word in printed
    assert (tmp_path / "intent.onnx").exists()


@pytest.mark.parametrize(
    "arguments", [["--preset", "huge"], ["--seed", "-1"], ["--seed", "x"], ["--rate", "1"]]
)
def test_wrong_usage_is_one_line_and_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(["train", *arguments])
    assert left.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
