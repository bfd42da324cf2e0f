from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cli.main import main
from services.classifier.model import OnnxModel
from services.classifier.window import MODEL_RATE_HZ
from training import adaptation as adapting
from training import finetune as finetuning
from training.adaptation import LEARNING, Adaptation, Learned
from training.dataset.primitive import Primitive
from training.dataset.store import save as save_set
from training.evaluation import unusual as studying
from training.evaluation.unusual import JUDGED, SHOWN, adaptation_study
from training.export import export, load, save
from training.finetune import in_flight
from training.fit import Budget, Fitted, Training, said
from training.generator.dataset import generate
from training.labels import NONE, PRIMITIVES
from training.network import VERSION
from training.people import Share
from training.windows import Examples, examples_of, seen_after


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
    monkeypatch.setattr(adapting, "STEPS", 20)
    monkeypatch.setattr(finetuning, "OTHERS", Share(4, 0.01, 2, 0.01))


@pytest.fixture
def ana() -> list[Primitive]:
    """Calls every shape by the next one's name, always."""
    swapped = dict(zip(PRIMITIVES, (*PRIMITIVES[1:], PRIMITIVES[0]), strict=True))
    performed = generate(1, dict.fromkeys(PRIMITIVES, 5), seed=9)
    return [replace(one, label=swapped[one.label], operator="ana") for one in performed]


def test_what_is_computed_once_is_what_the_network_computes(
    fitted: Fitted, others: Examples
) -> None:
    windows = seen_after(others, None)
    shapes, meant = said(fitted.network, windows)
    seen = adapting._seen(fitted.network, windows)
    known_shapes, known_meant = fitted.network.answers(seen.features)
    assert torch.equal(seen.labels, torch.from_numpy(windows.labels))
    assert torch.allclose(shapes, known_shapes, atol=1e-5)
    assert torch.allclose(meant, known_meant, atol=1e-5)


def test_adapting_is_seeded_and_leaves_what_sticks_draw_alone(
    fitted: Fitted, others: Examples, ana: list[Primitive], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapting, "OWN_WEIGHT", 10.0)
    monkeypatch.setattr(adapting, "LEARNING_RATE", 1e-2)
    one, other = (Adaptation(fitted, others, 2).to(examples_of(ana)) for _ in range(2))
    assert one.of_use
    assert one.after > one.before
    before = fitted.network.state_dict()
    moved = set()
    for name, weights in one.fitted.network.state_dict().items():
        assert torch.equal(weights, other.fitted.network.state_dict()[name])
        if not torch.equal(weights, before[name]):
            moved.add(name)
    assert moved
    assert all(name.startswith(LEARNING) for name in moved)


def test_who_gains_nothing_keeps_the_network(
    fitted: Fitted, others: Examples, ana: list[Primitive], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapting, "LEARNING_RATE", 0.0)
    learned = Adaptation(fitted, others, 2).to(examples_of(ana))
    assert not learned.of_use
    assert learned.fitted is fitted
    assert learned.after == learned.before


def test_sure_answers_to_what_is_left_out_are_counted_as_the_model_would_give_them(
    fitted: Fitted, others: Examples, ana: list[Primitive], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapting, "LEARNING_RATE", 0.0)
    own = examples_of(ana)
    probabilities, meant = fitted.answers(seen_after(own, None))
    confidence = meant * probabilities.max(axis=1)
    least = float(np.sort(confidence)[7])
    right = (probabilities.argmax(axis=1) == own.labels)[confidence >= least]
    learned = Adaptation(replace(fitted, confidence_min=least), others, 2).to(own)
    assert (learned.given, learned.given_right) == (len(own) - 7, right.sum())
    certain = Adaptation(replace(fitted, confidence_min=1.1), others, 2).to(own)
    assert (certain.given, certain.given_right) == (0, 0)


class _Recorder:
    """Stands for an adaptation; keeps what it was shown."""

    shown: list[Examples]

    def __init__(self, fitted: Fitted, _others: Examples, _seed: int) -> None:
        self._adapted = replace(fitted, confidence_min=0.5)
        self._fitted = fitted
        _Recorder.shown = []

    def to(self, own: Examples) -> Learned:
        _Recorder.shown.append(own)
        of_use = len(_Recorder.shown) > 1
        return Learned(self._adapted if of_use else self._fitted, 0.0, 1.0, of_use, 0, 0)


def test_the_study_judges_on_performances_of_the_same_person_that_were_not_shown(
    fitted: Fitted, others: Examples, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Fitted, Examples]] = []

    def f1_of(network: Fitted, examples: Examples) -> float:
        asked.append((network, examples))
        return 0.5 if network.confidence_min == 0.5 else 0.25

    monkeypatch.setattr(studying, "Adaptation", _Recorder)
    monkeypatch.setattr(studying, "f1_of", f1_of)
    still = replace(fitted, confidence_min=0.4)
    found = adaptation_study(still, others, others, 4, odd=2, clumsy=1)
    assert [one.kind for one in found] == ["odd", "odd", "clumsy"]
    assert len({(one.kind, one.operator) for one in found}) == 3
    first, *rest = found
    # Who gains nothing is as before, and so is everybody else.
    assert (first.own_after, first.others_after) == (0.25, 0.25)
    assert all((one.own_after, one.others_after) == (0.5, 0.5) for one in rest)
    assert all((one.own_before, one.others_before) == (0.25, 0.25) for one in found)
    for shown in _Recorder.shown:
        assert np.bincount(shown.labels).tolist() == [SHOWN] * len(PRIMITIVES)
        seen = {track.tobytes() for track in shown.tracks}
        judged = [e for _, e in asked if e is not others and e.operators[0] == shown.operators[0]]
        judged = [e for e in judged if e.families[0] == shown.families[0]]
        assert judged
        for examples in judged:
            assert np.bincount(examples.labels).tolist() == [JUDGED] * len(PRIMITIVES)
            assert set(examples.operators) == set(shown.operators)
            assert not seen & {track.tobytes() for track in examples.tracks}


def test_neutral_sticks_around_a_primitive_are_cut_as_in_flight() -> None:
    pushes = np.full((60, 4), 0.5)
    pushes[20:30] = 0.0
    padded = np.concatenate([np.zeros((10, 4)), pushes, np.zeros((130, 4))])
    times_s = np.arange(len(padded)) / MODEL_RATE_HZ
    primitives = [
        Primitive(times_s, padded, "arc", "ana", "", ""),
        Primitive(times_s, padded, NONE, "ana", "", ""),
    ]
    arc, none = in_flight(examples_of(primitives)).tracks
    assert np.array_equal(arc, pushes.astype(np.float32))
    assert len(none) == len(padded)


def test_weights_survive_the_disk(fitted: Fitted, tmp_path: Path) -> None:
    save(fitted, tmp_path / "intent.pt")
    again = load(tmp_path / "intent.pt")
    export(fitted, PRIMITIVES, "intent", tmp_path / "one" / "intent.onnx")
    export(again, PRIMITIVES, "intent", tmp_path / "other" / "intent.onnx")
    one, other = (tmp_path / folder / "intent.onnx" for folder in ("one", "other"))
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("version", [None, VERSION - 1])
def test_weights_of_another_network_are_refused_though_they_fit(
    fitted: Fitted, tmp_path: Path, version: int | None
) -> None:
    path = tmp_path / "intent.pt"
    save(fitted, path)
    state = torch.load(path, weights_only=True)
    del state["version"]
    torch.save(state if version is None else {**state, "version": version}, path)
    with pytest.raises(OSError, match="not of this version's network"):
        load(path)


@pytest.fixture
def base(fitted: Fitted, tmp_path: Path) -> Path:
    path = tmp_path / "base" / "intent.onnx"
    export(fitted, PRIMITIVES, "intent", path)
    save(fitted, path.with_suffix(".pt"))
    return path


def test_the_command_writes_a_model_of_its_own(
    base: Path, ana: list[Primitive], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "ana.npz"
    save_set(own, ana)
    command = ["train", "--finetune", str(own), "--model", str(base)]
    assert main([*command, "--out", str(tmp_path / "ana")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "20 performances by ana" in told
    assert "of 20 are answered surely enough to be suggested" in told
    assert OnnxModel(tmp_path / "ana" / "intent.onnx").labels == PRIMITIVES
    assert (tmp_path / "ana" / "intent.pt").exists()

    assert main([*command, "--out", str(base.parent)]) == 2
    assert "another folder" in capsys.readouterr().err
    save_set(
        own, [one for one in ana if one.label != "arc"] + [p for p in ana if p.label == "arc"][:1]
    )
    assert main([*command, "--out", str(tmp_path / "ana")]) == 2
    error = capsys.readouterr().err
    assert "1 performances of arc" in error
    assert len(error.splitlines()) == 1


def test_faulty_performances_are_left_out_and_a_faulty_person_is_told_of(
    base: Path, ana: list[Primitive], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "ana.npz"
    flat = [replace(one, sticks=one.sticks * [1.0, 0.0, 1.0, 1.0]) for one in ana]
    hung = replace(flat[0], sticks=np.tile([0.5, 0.0, 0.0, 0.0], (len(flat[0]), 1)))
    # Names are no markup.
    save_set(own, [replace(one, operator="[/ana]") for one in (*flat, hung)])
    command = ["train", "--finetune", str(own), "--model", str(base)]
    assert main([*command, "--out", str(tmp_path / "ana")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "left out: row 20: arc by [/ana]: every sample is the same" in told
    assert "look at this: operator [/ana]: vy never moves in 21 primitives" in told
    assert "20 performances by [/ana]: F1" in told


def test_a_model_is_adapted_to_one_person_of_a_file(
    base: Path, ana: list[Primitive], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = tmp_path / "both.npz"
    save_set(both, [*ana, *generate(1, dict.fromkeys(PRIMITIVES, 3), seed=10)])
    command = ["train", "--finetune", str(both), "--model", str(base), "--out", str(tmp_path / "a")]
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "ana, steady-0000" in error
    assert "--operator" in error
    assert main([*command, "--operator", "ben"]) == 2
    assert "ana, steady-0000" in capsys.readouterr().err
    assert main([*command, "--operator", "ana"]) == 0
    assert "20 performances by ana" in capsys.readouterr().out
    assert main(["train", "--operator", "ana"]) == 2
    assert "--finetune" in capsys.readouterr().err


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
