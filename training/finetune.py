"""Adapts a trained network to one person from a few of that person's own performances."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812

from training.dataset.primitive import Primitive
from training.export import export, load, save
from training.fit import FULL_YAW_RADPS, THREADS, Fitted, inputs_of, loss_of, said
from training.generator.dataset import Population, populate
from training.generator.people import FAMILIES
from training.labels import PRIMITIVES
from training.people import Share, Tell, people_of
from training.scores import weighted_f1
from training.windows import (
    NONE_INDEX,
    Examples,
    IntArray,
    Windows,
    examples_of,
    padded,
    random_tracks,
    random_windows,
    seen_after,
)

STEPS = 150
OWN_BATCH, REPLAY_BATCH = 32, 64
LEARNING_RATE = 1e-3
OWN_WEIGHT = 0.5
"""Of the person's own loss, beside that of keeping to the old answers for others."""
PULL = 0.02
"""Towards the old weights: of the squared distance of all of them together."""
LEARNING = ("head.", "reader.", "encoder.gru.")
"""Layers that adapt; what the sticks draw is the same for everybody."""
CUTS = 2
FEWEST = 3
"""Performances of each primitive: fewer leave nothing to check by."""


def adapt(fitted: Fitted, own: Examples, replay: Examples, seed: int) -> Fitted:
    """A network that knows one person better, and everybody else as well as before.

    It learns the person's performances, cut and mirrored anew in every step, while its answers to
    other people are held to the old ones. Batch norms and calibration stay as they are.

    Args:
        fitted: the network to begin with.
        own: the person's performances.
        replay: other people's, so that they are not forgotten.
        seed: the same seed gives the same network.
    """
    torch.set_num_threads(THREADS)
    rng = np.random.default_rng(seed)
    network = copy.deepcopy(fitted.network).eval().requires_grad_(False)
    others = [random_windows(replay, rng, augment=False) for _ in range(CUTS)]
    answers = [said(fitted.network, windows) for windows in others]
    moving = {
        name: weights.requires_grad_()
        for name, weights in network.named_parameters()
        if name.startswith(LEARNING)
    }
    before = {name: weights.detach().clone() for name, weights in moving.items()}
    optimiser = torch.optim.Adam(moving.values(), lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    for step in range(STEPS):
        optimiser.zero_grad()
        rows = rng.integers(len(own), size=OWN_BATCH)
        drawn = own.rows(rows)
        windows = padded(random_tracks(drawn, rng), drawn.labels)
        logits, meant = network(*inputs_of(windows, FULL_YAW_RADPS))
        loss = OWN_WEIGHT * loss_of(logits, meant, torch.from_numpy(windows.labels))
        kept = int(step % CUTS)
        index = rng.integers(len(replay), size=REPLAY_BATCH)
        logits, meant = network(*inputs_of(_rows(others[kept], index), FULL_YAW_RADPS))
        old_logits, old_meant = answers[kept]
        loss = loss + _departure(logits, meant, old_logits[index], old_meant[index])
        loss = loss + PULL * sum(
            ((weights - before[name]) ** 2).sum() for name, weights in moving.items()
        )
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    return replace(fitted, network=network)


def _rows(windows: Windows, index: IntArray) -> Windows:
    samples = int(windows.lengths[index].max())
    return Windows(
        windows.sticks[index, :samples],
        windows.times_s[index, :samples],
        windows.lengths[index],
        windows.labels[index],
    )


def _departure(logits: Tensor, meant: Tensor, old_logits: Tensor, old_meant: Tensor) -> Tensor:
    """How far answers are from the old ones: cross-entropies against them."""
    shapes = F.cross_entropy(logits, torch.softmax(old_logits, 1))
    return shapes + F.binary_cross_entropy_with_logits(meant, torch.sigmoid(old_meant))


def f1_of(fitted: Fitted, examples: Examples) -> float:
    """Weighted F1 of primitives at their end."""
    shapes = examples.rows(np.flatnonzero(examples.labels != NONE_INDEX))
    return weighted_f1(shapes.labels, fitted.probabilities(seen_after(shapes, None)).argmax(1))


def cross_checked(
    fitted: Fitted, own: Examples, replay: Examples, seed: int, folds: int = 3
) -> tuple[float, float]:
    """F1 on a person's performances before, and after adapting to the others of them."""
    rng = np.random.default_rng(seed)
    fold = np.empty(len(own), dtype=np.int64)
    for label in np.unique(own.labels):
        rows = rng.permutation(np.flatnonzero(own.labels == label))
        fold[rows] = np.arange(len(rows)) % folds
    truth, then, now = [], [], []
    for number in range(folds):
        held = own.rows(np.flatnonzero((fold == number) & (own.labels != NONE_INDEX)))
        if not len(held):
            continue
        adapted = adapt(fitted, own.rows(np.flatnonzero(fold != number)), replay, seed)
        windows = seen_after(held, None)
        truth.append(held.labels)
        then.append(fitted.probabilities(windows).argmax(1))
        now.append(adapted.probabilities(windows).argmax(1))
    labels = np.concatenate(truth)
    return weighted_f1(labels, np.concatenate(then)), weighted_f1(labels, np.concatenate(now))


UNUSUAL = Population("unusual", FAMILIES, difficulty=2.0)
"""People who execute everything twice as badly as ordinary ones of their families."""


@dataclass(frozen=True)
class Adapted:
    """One person's F1 before and after, and everybody else's."""

    operator: str
    own_before: float
    own_after: float
    others_before: float
    others_after: float


def adaptation_study(
    fitted: Fitted,
    replay: Examples,
    others: Examples,
    seed: int,
    people: int = 12,
    candidates: int = 36,
    screened: int = 8,
    shown: int = 5,
    judged: int = 20,
) -> tuple[Adapted, ...]:
    """What `shown` examples a class do for unusual people, and cost the others.

    Of the candidates the worst served are taken, by performances that are used for nothing else, so
    that their scores do not rise by regression to the mean.

    Args:
        fitted: the network to begin with.
        replay: performances of people that it learned from.
        others: people who have been used for nothing yet.
        seed: of the people and of the adaptation.
        people: how many adapt.
        candidates: how many there are to choose from.
        screened: performances of each class and person to choose by.
        shown: to adapt to.
        judged: to judge on.
    """
    each = screened + shown + judged
    counts = dict.fromkeys(PRIMITIVES, candidates * each)
    performed = populate(UNUSUAL, candidates, counts, seed)
    examples = examples_of(performed)
    turn = _turns_of(performed)
    screening, own, test = (
        np.flatnonzero((turn >= low) & (turn < high))
        for low, high in ((0, screened), (screened, screened + shown), (screened + shown, each))
    )
    names = list(dict.fromkeys(one.operator for one in performed))

    def of(rows: IntArray, name: str) -> Examples:
        return examples.rows(rows[examples.operators[rows] == name])

    served = {name: f1_of(fitted, of(screening, name)) for name in names}
    others_before = f1_of(fitted, others)
    found = []
    for name in sorted(names, key=lambda name: (served[name], name))[:people]:
        adapted = adapt(fitted, of(own, name), replay, seed)
        found.append(
            Adapted(
                name,
                f1_of(fitted, of(test, name)),
                f1_of(adapted, of(test, name)),
                others_before,
                f1_of(adapted, others),
            )
        )
    return tuple(found)


def _turns_of(performed: list[Primitive]) -> IntArray:
    """Each performance's number among those of its person and label."""
    seen: dict[tuple[str, str], int] = {}
    turns = []
    for one in performed:
        key = (one.operator, one.label)
        turns.append(seen.get(key, 0))
        seen[key] = turns[-1] + 1
    return np.array(turns, dtype=np.int64)


REPLAY = Share(wide_people=60, wide=0.4, thesis_people=20, thesis=0.1)
REPLAY_SEED = 20_000
"""Of people who stand for everybody else; any others would do."""


@dataclass(frozen=True)
class Finetuned:
    """A model for one person.

    Attributes:
        path: of the file.
        sha256: of it.
        performances: that it was adapted to.
        before: F1 on them by the model it began with.
        after: F1 on those left out of each of three adaptations to the others.
    """

    path: Path
    sha256: str
    performances: int
    before: float
    after: float


def finetune(
    primitives: Sequence[Primitive], model: Path, out: Path, seed: int, tell: Tell
) -> Finetuned:
    """Adapt a model to one person and write it to `out`.

    Args:
        primitives: the person's performances.
        model: the ONNX file to begin with; its weights lie beside it, as `.pt`.
        out: folder.
        seed: the same seed gives the same file.
        tell: told how far the people are who stand for everybody else.

    Raises:
        ValueError: if there are too few performances, or `out` holds the model to begin with.
        OSError: if the model's weights cannot be read.
    """
    if out.resolve() == model.parent.resolve():
        raise ValueError(f"--out {out}: holds the model to begin with; name another folder")
    fitted = load(model.with_suffix(".pt"))
    own = examples_of(primitives)
    shapes = np.bincount(own.labels, minlength=NONE_INDEX)[:NONE_INDEX]
    if shapes.min() < FEWEST:
        label = PRIMITIVES[int(shapes.argmin())]
        raise ValueError(
            f"--finetune: {shapes.min()} performances of {label}; record {FEWEST} of each primitive"
            " at least, better 5 or more"
        )
    replay = examples_of(people_of("replay", REPLAY, REPLAY_SEED, tell=tell))
    before, after = cross_checked(fitted, own, replay, seed)
    adapted = adapt(fitted, own, replay, seed)
    path = out / model.name
    sha256 = export(adapted, PRIMITIVES, model.stem, path)
    save(adapted, path.with_suffix(".pt"))
    return Finetuned(path, sha256, len(own), before, after)
