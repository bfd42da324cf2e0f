"""Makes what a network says of its own certainty true, on people it has not learned from."""

import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F  # noqa: N812

RIGHT_SHARE = 0.95
"""Of the answers above `confidence_min`."""
FEWEST = 20
"""Answers that a share is counted over."""
USUAL_SAMPLES = 100
"""2 s."""

Scaling = tuple[float, float]
"""What `scaled` goes by."""


def _fitted(parameters: Tensor, loss_of_them: Callable[[], Tensor]) -> None:
    """Moves parameters to where a loss is least."""
    optimiser = torch.optim.LBFGS([parameters], lr=0.5, max_iter=100, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimiser.zero_grad()
        loss = loss_of_them()
        loss.backward()  # type: ignore[no-untyped-call]
        return loss

    optimiser.step(closure)  # type: ignore[no-untyped-call]


def scaling_of(logits: Tensor, lengths: Tensor, labels: Tensor) -> Scaling:
    """The scaling that makes probabilities match how often they are right.

    Args:
        logits: (n, 4) of the primitives.
        lengths: (n,) samples in each window.
        labels: (n,) indices of the primitives.
    """
    row = torch.zeros(2, requires_grad=True)
    _fitted(row, lambda: F.cross_entropy(scaled(logits, lengths, row), labels))
    usual, per_e_fold = row.detach().tolist()
    return usual, per_e_fold


def scaled(logits: Tensor, lengths: Tensor, scaling: Tensor) -> Tensor:
    """Logits (n, 4) over a temperature (Guo et al. 2017) that goes with the length of the window.

    A short one is more often the beginning of something else than training's whole ones tell.

    Args:
        logits: (n, 4).
        lengths: (n,) samples.
        scaling: (2,) logarithm of 1 / temperature at `USUAL_SAMPLES`, and what each factor of e in
            the length adds to it.
    """
    usual, per_e_fold = torch.split(scaling, 1)
    # exp(usual + log(length / USUAL_SAMPLES) * per_e_fold) in fewer operations: what a window of
    # one sample would have is constant, and the length only to a power.
    usual = torch.exp(usual - math.log(USUAL_SAMPLES) * per_e_fold)
    return logits * (usual * lengths.view(-1, 1).to(logits.dtype) ** per_e_fold)


def platt_of(logit: Tensor, is_meant: Tensor) -> tuple[float, float]:
    """Scale and shift that make a logit's sigmoid a probability (Platt 1999)."""
    line = torch.tensor([1.0, 0.0], requires_grad=True)
    wanted = is_meant.to(logit.dtype)
    _fitted(line, lambda: F.binary_cross_entropy_with_logits(logit * line[0] + line[1], wanted))
    scale, shift = line.detach().tolist()
    return scale, shift


def confidence_min_of(
    probabilities: NDArray[np.float32], meant: NDArray[np.float32], labels: NDArray[np.int64]
) -> float:
    """The least confidence from which on `RIGHT_SHARE` of all answers are right.

    Args:
        probabilities: (n, 4) of the primitives.
        meant: (n,) that there is one.
        labels: (n,) what it was; naming a primitive where none was meant is wrong.

    Returns:
        In [0, 1]; 1 if no threshold does it.
    """
    confidence = meant * probabilities.max(axis=1)
    right = probabilities.argmax(axis=1) == labels
    order = np.argsort(-confidence, kind="stable")
    ranked = confidence[order]
    share = np.cumsum(right[order]) / np.arange(1, len(order) + 1)
    # A threshold takes all answers of the same confidence, or none of them.
    is_last = np.append(ranked[1:] < ranked[:-1], True)
    good = np.flatnonzero(is_last & (share >= RIGHT_SHARE))
    good = good[good >= min(FEWEST, len(order)) - 1]
    return float(ranked[good[-1]]) if len(good) else 1.0
