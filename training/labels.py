"""What a person's sticks can mean: the four primitives, or none of them."""

from common.messages import NONE_LABEL

PRIMITIVES = ("line", "arc", "sine", "helix")
"""In the order of a model's probabilities."""
NONE = NONE_LABEL
"""Rest, turning on the spot, hover corrections, free flight."""
CLASSES = (*PRIMITIVES, NONE)
