"""What a person's sticks can mean: the four primitives, or none of them."""

from common.messages import NONE_LABEL as NONE
from common.messages import PRIMITIVES

__all__ = ["CLASSES", "NONE", "PRIMITIVES"]

CLASSES = (*PRIMITIVES, NONE)
"""Primitives are in the order of a model's probabilities; none is rest, turning on the spot, hover
corrections, free flight."""
