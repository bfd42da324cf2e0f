"""`autocomplete train --finetune`: from one person's performances to a model file of their own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from common.sticks import DEAD_BAND
from services.classifier.model import SHORTEST_SAMPLES
from training.adaptation import Adaptation, Learned
from training.dataset.primitive import Primitive
from training.export import export, load, save
from training.labels import PRIMITIVES
from training.people import Share, Tell, people_of
from training.windows import NONE_INDEX, Examples, examples_of

FEWEST = 3
"""Performances of each primitive: fewer leave nothing to check by."""
OTHERS = Share(wide_people=120, wide=0.5, thesis_people=60, thesis=0.25)
OTHERS_SEED = 20_000
"""Of people who stand for everybody else; any others would do."""


@dataclass(frozen=True)
class Finetuned:
    """A model for one person.

    Attributes:
        path: of the file.
        sha256: of it.
        operator: who.
        performances: that it was adapted to.
        learned: what they came to; if nothing, the file is the model it began with.
    """

    path: Path
    sha256: str
    operator: str
    performances: int
    learned: Learned


def finetune(
    primitives: Sequence[Primitive],
    model: Path,
    out: Path,
    seed: int,
    tell: Tell,
    operator: str | None = None,
) -> Finetuned:
    """Adapt a model to one person and write it to `out`.

    Args:
        primitives: performances, the person's among them.
        model: the ONNX file to begin with; its weights lie beside it, as `.pt`.
        out: folder.
        seed: the same seed gives the same file.
        tell: told how far the people are who stand for everybody else.
        operator: who the person is; None if all performances are of one.

    Raises:
        ValueError: if it is not clear who the person is, there are too few performances, or `out`
            holds the model to begin with.
        OSError: if the model's weights cannot be read.
    """
    if out.resolve() == model.parent.resolve():
        raise ValueError(f"--out {out}: holds the model to begin with; name another folder")
    fitted = load(model.with_suffix(".pt"))
    who, performed = of_operator(primitives, operator)
    own = in_flight(examples_of(performed))
    shapes = np.bincount(own.labels, minlength=NONE_INDEX)[:NONE_INDEX]
    if shapes.min() < FEWEST:
        label = PRIMITIVES[int(shapes.argmin())]
        raise ValueError(
            f"--finetune: {shapes.min()} performances of {label} by {who}; record {FEWEST} of each"
            " primitive at least, better 5 or more"
        )
    others = examples_of(people_of("others", OTHERS, OTHERS_SEED, tell=tell))
    learned = Adaptation(fitted, others, seed).to(own)
    path = out / model.name
    sha256 = export(learned.fitted, PRIMITIVES, model.stem, path)
    save(learned.fitted, path.with_suffix(".pt"))
    return Finetuned(path, sha256, who, len(own), learned)


def of_operator(
    primitives: Sequence[Primitive], operator: str | None
) -> tuple[str, list[Primitive]]:
    """The person's name and performances.

    Raises:
        ValueError: if there are several people and none is chosen, or not the one chosen.
    """
    names = sorted({one.operator for one in primitives})
    if operator is None and len(names) > 1:
        raise ValueError(
            f"--finetune: the file holds {len(names)} people's performances ({', '.join(names)});"
            " a model is adapted to one of them, name them with --operator"
        )
    who = names[0] if operator is None else operator
    if who not in names:
        raise ValueError(f"--operator {who}: nobody of this name; there is {', '.join(names)}")
    return who, [one for one in primitives if one.operator == who]


def in_flight(examples: Examples) -> Examples:
    """Primitives without neutral sticks around them, which no window in flight has."""
    tracks = []
    for track, label in zip(examples.tracks, examples.labels, strict=True):
        pushes = np.flatnonzero(np.abs(track[:, :3]).max(axis=1) > DEAD_BAND)
        if label == NONE_INDEX or len(pushes) == 0:
            tracks.append(track)
            continue
        end = max(int(pushes[-1]) + 1, SHORTEST_SAMPLES)
        begin = min(int(pushes[0]), end - SHORTEST_SAMPLES)
        tracks.append(track[begin:end])
    return replace(examples, tracks=tuple(tracks))
