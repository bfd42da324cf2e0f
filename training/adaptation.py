"""A network learns one person from a few performances, and answers everybody else as before."""

import copy
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812

from training.calibration import scaled
from training.fit import FULL_YAW_RADPS, THREADS, Fitted, inputs_of, loss_of
from training.network import Network
from training.scores import weighted_f1
from training.windows import (
    NONE_INDEX,
    Examples,
    IntArray,
    Windows,
    joined,
    padded,
    random_windows,
    seen_after,
)

STEPS = 100
OWN_BATCH, OTHERS_BATCH = 64, 192
LEARNING_RATE = 3e-3
OWN_WEIGHT = 0.05
"""Of the person's own loss, beside that of departing from the old answers to others."""
PULL = 1e-3
"""Towards the old weights: of the squared distance of all of them together."""
LEARNING = ("reader.", "head.")
"""Layers that learn: what sticks draw is the same for everybody, what is meant by it is not."""
BATCH = 256
CUTS = 4
"""Windows of each of the person's performances beside the whole one; both count the same."""
FOLDS = 3


@dataclass(frozen=True)
class Learned:
    """What a person's performances came to.

    Attributes:
        fitted: the network that knows the person; the old one if that would not be of use.
        before: F1 of the old one on the performances.
        after: F1 on those left out of each of `FOLDS` adaptations to the others of them.
        of_use: whether more of them were named right than before.
        given: of those left out, `none` too, so many are answered surely enough to be suggested: by
            adapted networks, or by the old one if that is kept.
        given_right: so many of these answers are right.
    """

    fitted: Fitted
    before: float
    after: float
    of_use: bool
    given: int
    given_right: int


@dataclass(frozen=True)
class _Seen:
    """Windows as the layers that learn get them: features, each (n, k), lengths and labels (n,)."""

    features: list[Tensor]
    lengths: Tensor
    labels: Tensor

    def rows(self, index: IntArray) -> "_Seen":
        """Those at these places."""
        some = torch.from_numpy(index)
        return _Seen([each[some] for each in self.features], self.lengths[some], self.labels[some])


def _seen(network: Network, windows: Windows) -> _Seen:
    """What a network sees in windows: computed once, since only what it means is learned."""
    # Windows of alike lengths together: little is padded.
    order = np.argsort(windows.lengths, kind="stable")
    parts = []
    for begin in range(0, len(windows), BATCH):
        rows = order[begin : begin + BATCH]
        tracks = [windows.sticks[k, : windows.lengths[k]] for k in rows]
        with torch.no_grad():
            part = inputs_of(padded(tracks, windows.labels[rows]), FULL_YAW_RADPS)
            parts.append(network.features(*part))
    back = torch.from_numpy(np.argsort(order))
    features = [torch.cat(each)[back] for each in zip(*parts, strict=True)]
    return _Seen(features, torch.from_numpy(windows.lengths), torch.from_numpy(windows.labels))


class Adaptation:
    """Adapts a network to one person after the other, always from the same beginning.

    What is made of windows below the layers that learn is computed once, so that a hundred steps
    cost less than a second. Norms and calibration stay as they are.

    Args:
        fitted: the network to begin with.
        others: performances by other people, so that they are not forgotten.
        seed: the same seed gives the same networks.
    """

    def __init__(self, fitted: Fitted, others: Examples, seed: int) -> None:
        torch.set_num_threads(THREADS)
        self._fitted, self._seed = fitted, seed
        rng = np.random.default_rng(seed)
        windows = joined([seen_after(others, None), random_windows(others, rng, augment=False)])
        self._base = copy.deepcopy(fitted.network).eval().requires_grad_(False)
        self._others = _seen(self._base, windows)
        logits, meant = self._base.answers(self._others.features)
        self._old = torch.softmax(logits, 1), torch.sigmoid(meant)

    def to(self, own: Examples) -> Learned:
        """Learn a person's performances, if those left out on trial gain by it."""
        rng = np.random.default_rng(self._seed)
        cuts = [random_windows(own, rng, augment=False) for _ in range(CUTS)]
        seen = _seen(self._base, joined([seen_after(own, None), *cuts]))
        number = np.tile(np.arange(len(own)), 1 + CUTS)
        fold = np.empty(len(own), dtype=np.int64)
        for label in np.unique(own.labels):
            rows = rng.permutation(np.flatnonzero(own.labels == label))
            fold[rows] = np.arange(len(rows)) % FOLDS
        # Of each performance what is said, and whether surely enough.
        then, now = (np.empty((len(own), 2), dtype=np.int64) for _ in range(2))
        for left_out in np.unique(fold):
            held = np.flatnonzero(fold == left_out)
            part = self._learned(seen, np.flatnonzero(fold[number] != left_out), len(own))
            then[held], now[held] = (
                self._said(network, seen.rows(held)) for network in (self._base, part)
            )
        meant = own.labels != NONE_INDEX
        before, after = (weighted_f1(own.labels[meant], said[meant, 0]) for said in (then, now))
        right = [said[:, 0] == own.labels for said in (then, now)]
        of_use = bool(right[1].sum() > right[0].sum())
        fitted = self._fitted
        if of_use:
            network = self._learned(seen, np.arange(len(number)), len(own))
            fitted = replace(fitted, network=network)
        sure = (now if of_use else then)[:, 1] > 0
        given_right = int((sure & right[of_use]).sum())
        return Learned(fitted, before, after, of_use, int(sure.sum()), given_right)

    def _said(self, network: Network, windows: _Seen) -> IntArray:
        """The likeliest primitive of each window, and whether that is a sure answer, (n, 2)."""
        logits, logit = network.answers(windows.features)
        scale, shift = self._fitted.platt
        scaling = torch.tensor(self._fitted.scaling)
        likeliest = torch.softmax(scaled(logits, windows.lengths, scaling), 1).max(1)
        confidence = likeliest.values * torch.sigmoid(logit * scale + shift)
        sure = confidence >= self._fitted.confidence_min
        return torch.stack([likeliest.indices, sure.long()], 1).numpy()

    def _learned(self, own: _Seen, rows: IntArray, whole: int) -> Network:
        """A network fitted to some of a person's windows, of which the first are whole ones."""
        rng = np.random.default_rng(self._seed)
        network = copy.deepcopy(self._base)
        moving = {
            name: weights.requires_grad_()
            for name, weights in network.named_parameters()
            if name.startswith(LEARNING)
        }
        before = {name: weights.detach().clone() for name, weights in moving.items()}
        optimiser = torch.optim.Adam(moving.values(), lr=LEARNING_RATE)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
        wholes, cuts = rows[rows < whole], rows[rows >= whole]
        for _ in range(STEPS):
            optimiser.zero_grad()
            drawn = np.concatenate([rng.choice(part, OWN_BATCH // 2) for part in (wholes, cuts)])
            shown = own.rows(drawn)
            loss = OWN_WEIGHT * loss_of(*network.answers(shown.features), shown.labels)
            index = rng.integers(len(self._others.labels), size=OTHERS_BATCH)
            logits, meant = network.answers(self._others.rows(index).features)
            old_shapes, old_meant = (old[torch.from_numpy(index)] for old in self._old)
            loss = loss + F.cross_entropy(logits, old_shapes)
            loss = loss + F.binary_cross_entropy_with_logits(meant, old_meant)
            departed = [((weights - before[name]) ** 2).sum() for name, weights in moving.items()]
            loss = loss + PULL * torch.stack(departed).sum()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()
        return network.requires_grad_(False)
