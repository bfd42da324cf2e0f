"""Makes what a network says of its own certainty true, on people it has not learned from."""

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


def _fitted(parameters: Tensor, loss_of_them: Callable[[], Tensor]) -> None:
    """Moves parameters to where a loss is least."""
    optimiser = torch.optim.LBFGS([parameters], lr=0.5, max_iter=100, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimiser.zero_grad()
        loss = loss_of_them()
        loss.backward()  # type: ignore[no-untyped-call]
        return loss

    optimiser.step(closure)  # type: ignore[no-untyped-call]


def temperature_of(logits: Tensor, labels: Tensor) -> float:
    """The temperature that makes probabilities match how often they are right (Guo et al. 2017)."""
    log_t = torch.zeros(1, requires_grad=True)
    _fitted(log_t, lambda: F.cross_entropy(logits / log_t.exp(), labels))
    return float(log_t.exp().item())


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
