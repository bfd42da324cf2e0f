"""Fits the network: Adam, class weights, early stopping on the validation loss, a temperature."""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from training.network import CnnGru
from training.windows import Examples, Windows, random_windows

BATCH = 128
LEARNING_RATE = 2e-3
WEIGHT_DECAY = 1e-4
PATIENCE_EPOCHS = 8
VALIDATION_CUTS = 2
THREADS = 1
"""One order of sums, so the same seed gives the same network on any number of cores."""


@dataclass(frozen=True)
class Epoch:
    """How an epoch went; losses are cross-entropies in nats."""

    number: int
    training_loss: float
    validation_loss: float
    validation_accuracy: float
    is_best: bool


@dataclass(frozen=True)
class Fitted:
    """A trained network, its temperature and its history."""

    network: CnnGru
    temperature: float
    history: tuple[Epoch, ...]


def logits_of(network: CnnGru, windows: Windows, batch: int = 512) -> torch.Tensor:
    """Logits (n, classes) of windows."""
    network.eval()
    parts = []
    with torch.no_grad():
        for begin in range(0, len(windows.labels), batch):
            rows = slice(begin, begin + batch)
            parts.append(
                network(
                    torch.from_numpy(windows.sticks[rows]), torch.from_numpy(windows.lengths[rows])
                )
            )
    return torch.cat(parts)


def class_weights(labels: NDArray[np.int64], classes: int) -> torch.Tensor:
    """Weights (classes,) that make every class count the same."""
    counts = np.bincount(labels, minlength=classes)
    return torch.tensor(len(labels) / (classes * counts), dtype=torch.float32)


def temperature_of(logits: torch.Tensor, labels: torch.Tensor) -> float:
    """The temperature that makes probabilities match how often they are right (Guo et al. 2017)."""
    log_t = torch.zeros(1, requires_grad=True)
    optimiser = torch.optim.LBFGS([log_t], lr=0.1, max_iter=60)

    def closure() -> torch.Tensor:
        optimiser.zero_grad()
        loss = nn.functional.cross_entropy(logits / log_t.exp(), labels)
        loss.backward()  # type: ignore[no-untyped-call]
        return loss

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    return float(log_t.exp().item())


def fit(
    training: Examples,
    validation: Examples,
    classes: int,
    epochs: int,
    seed: int,
    on_batch: Callable[[int, int], None] = lambda _done, _of: None,
    on_epoch: Callable[[Epoch], None] = lambda _: None,
) -> Fitted:
    """Train until the validation loss no longer falls, or for `epochs`; keep the best state.

    Args:
        training: what to learn from; cut anew in every epoch.
        validation: other operators' examples, cut the same way throughout.
        classes: how many labels.
        epochs: at most.
        seed: the same seed and machine give the same network.
        on_batch: told how many of how many batches of an epoch are done.
        on_epoch: told of each epoch.
    """
    torch.set_num_threads(THREADS)
    torch.manual_seed(seed)
    torch.use_deterministic_algorithms(True)
    rng = np.random.default_rng(seed)
    held = [random_windows(validation, rng, augment=False) for _ in range(VALIDATION_CUTS)]
    held_labels = torch.from_numpy(np.concatenate([w.labels for w in held]))
    network = CnnGru(classes)
    loss_of = nn.CrossEntropyLoss(class_weights(training.labels, classes), label_smoothing=0.02)
    optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs, LEARNING_RATE / 50)
    best_loss, best_state, best_epoch = float("inf"), network.state_dict(), 0
    history: list[Epoch] = []
    for number in range(1, epochs + 1):
        windows = random_windows(training, rng)
        order = rng.permutation(len(windows.labels))
        batches = [order[i : i + BATCH] for i in range(0, len(order), BATCH)]
        network.train()
        total = 0.0
        for done, rows in enumerate(batches, 1):
            optimiser.zero_grad()
            logits = network(
                torch.from_numpy(windows.sticks[rows]), torch.from_numpy(windows.lengths[rows])
            )
            loss = loss_of(logits, torch.from_numpy(windows.labels[rows]))
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            total += float(loss.item()) * len(rows)
            on_batch(done, len(batches))
        schedule.step()
        logits = torch.cat([logits_of(network, w) for w in held])
        held_loss = float(nn.functional.cross_entropy(logits, held_labels).item())
        is_best = held_loss < best_loss
        if is_best:
            best_loss, best_epoch = held_loss, number
            best_state = copy.deepcopy(network.state_dict())
        accuracy = float((logits.argmax(1) == held_labels).float().mean().item())
        epoch = Epoch(number, total / len(order), held_loss, accuracy, is_best)
        history.append(epoch)
        on_epoch(epoch)
        if number - best_epoch >= PATIENCE_EPOCHS:
            break
    network.load_state_dict(best_state)
    logits = torch.cat([logits_of(network, w) for w in held])
    return Fitted(network.eval(), temperature_of(logits, held_labels), tuple(history))
