"""Who is trained on, who is judged by: sets that share no operator. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from training.dataset.primitive import Primitive

TEST_SHARE = 0.2
VALIDATION_SHARE = 0.16
"""The thesis' shares: 20 % for the test, 20 % of the rest for validation."""


@dataclass(frozen=True)
class Split:
    """Three sets without a shared operator."""

    train: list[Primitive]
    validation: list[Primitive]
    test: list[Primitive]


def split_by_operator(
    primitives: Sequence[Primitive],
    seed: int,
    validation_share: float = VALIDATION_SHARE,
    test_share: float = TEST_SHARE,
) -> Split:
    """Deal whole operators to training, validation and test.

    Shares are of operators, at least one each.

    Args:
        primitives: of at least three operators.
        seed: the same seed deals the same operators to the same sets, in whatever order they come.
        validation_share: of the operators.
        test_share: of the operators.

    Raises:
        ValueError: if there are too few operators.
    """
    operators = sorted({p.operator for p in primitives})
    tested = max(1, round(test_share * len(operators)))
    validated = max(1, round(validation_share * len(operators)))
    if tested + validated >= len(operators):
        raise ValueError(
            f"{len(operators)} operators are too few for {tested} to test and {validated} to"
            " validate; collect from more people or take smaller shares"
        )
    order = np.random.default_rng(seed).permutation(len(operators))
    dealt = [operators[i] for i in order]
    test = set(dealt[:tested])
    validation = set(dealt[tested : tested + validated])
    return Split(
        [p for p in primitives if p.operator not in test | validation],
        [p for p in primitives if p.operator in validation],
        [p for p in primitives if p.operator in test],
    )
