from pathlib import Path

import numpy as np
import pytest
import torch

from cli.main import main
from services.classifier.model import OnnxModel
from training import finetune as finetuning
from training.dataset.store import save as save_set
from training.export import export, load, save
from training.finetune import adapt, adaptation_study, f1_of
from training.fit import Budget, Fitted, Training
from training.generator.dataset import generate
from training.labels import NONE, PRIMITIVES
from training.people import Share
from training.windows import Examples, examples_of


@pytest.fixture(scope="module")
def others() -> Examples:
    return examples_of(generate(8, dict.fromkeys((*PRIMITIVES, NONE), 24), seed=1))


@pytest.fixture(scope="module")
def fitted(others: Examples) -> Fitted:
    """A little trained."""
    run = Training(others, others, 0, Budget(windows=1200, batch=48))
    while not run.is_over:
        run.epoch()
    return run.fitted()


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(finetuning, "STEPS", 12)
    monkeypatch.setattr(finetuning, "REPLAY", Share(4, 0.01, 2, 0.01))


def test_adapting_is_seeded_and_moves_only_what_may_move(fitted: Fitted, others: Examples) -> None:
    own = others.rows(np.flatnonzero(others.operators == others.operators[0]))
    one, other = (adapt(fitted, own, others, seed=2) for _ in range(2))
    before = fitted.network.state_dict()
    moved = set()
    for name, weights in one.network.state_dict().items():
        assert torch.equal(weights, other.network.state_dict()[name])
        if not torch.equal(weights, before[name]):
            moved.add(name)
    assert moved
    assert all(name.startswith(finetuning.LEARNING) for name in moved)


def test_the_study_takes_the_worst_served_and_judges_on_what_nobody_chose_by(
    fitted: Fitted, others: Examples
) -> None:
    found = adaptation_study(
        fitted, others, others, 4, people=2, candidates=4, screened=2, shown=2, judged=3
    )
    assert len({one.operator for one in found}) == 2
    assert all(one.others_before == pytest.approx(f1_of(fitted, others)) for one in found)
    assert all(0.0 <= one.own_after <= 1.0 for one in found)


def test_weights_survive_the_disk(fitted: Fitted, tmp_path: Path) -> None:
    save(fitted, tmp_path / "intent.pt")
    again = load(tmp_path / "intent.pt")
    export(fitted, PRIMITIVES, "intent", tmp_path / "one" / "intent.onnx")
    export(again, PRIMITIVES, "intent", tmp_path / "other" / "intent.onnx")
    one, other = (tmp_path / folder / "intent.onnx" for folder in ("one", "other"))
    assert one.read_bytes() == other.read_bytes()


def test_the_command_writes_a_model_of_its_own(
    fitted: Fitted, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    base = tmp_path / "base" / "intent.onnx"
    export(fitted, PRIMITIVES, "intent", base)
    save(fitted, base.with_suffix(".pt"))
    own = tmp_path / "ana.npz"
    save_set(own, generate(1, dict.fromkeys(PRIMITIVES, 3), seed=9))
    command = ["train", "--finetune", str(own), "--model", str(base)]
    assert main([*command, "--out", str(tmp_path / "ana")]) == 0
    assert "12 performances" in capsys.readouterr().out
    assert OnnxModel(tmp_path / "ana" / "intent.onnx").labels == PRIMITIVES
    assert (tmp_path / "ana" / "intent.pt").exists()

    assert main([*command, "--out", str(base.parent)]) == 2
    assert "another folder" in capsys.readouterr().err
    save_set(own, generate(1, {**dict.fromkeys(PRIMITIVES, 3), "arc": 1}, seed=9))
    assert main([*command, "--out", str(tmp_path / "ana")]) == 2
    error = capsys.readouterr().err
    assert "1 performances of arc" in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize("content", [None, b"nonsense"])
def test_weights_that_cannot_be_read_are_told_in_one_line(
    content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    base = tmp_path / "base.onnx"
    if content is not None:
        base.with_suffix(".pt").write_bytes(content)
    own = tmp_path / "ana.npz"
    save_set(own, generate(1, dict.fromkeys(PRIMITIVES, 3), seed=9))
    arguments = [
        "train",
        "--finetune",
        str(own),
        "--model",
        str(base),
        "--out",
        str(tmp_path / "a"),
    ]
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert "base.pt" in error
    assert len(error.splitlines()) == 1
