"""Names that results, tables and figures share."""

OURS = "cnn-gru"
"""The project's own network."""
THESIS = "cnn-gru-thesis"
LITE = "LITE"
CALIBRATED = "calibrated"
"""People on whom the thesis' machine scores as in the thesis; held out."""
KNOWN = "known"
"""People of families that were learned from; held out."""
FAMILY = "family "
"""Begins the name of people of a family that nobody in training is of."""
WHOLE = "whole"
MOMENTS: dict[str, float | None] = {
    "1.0 s": 1.0,
    "1.5 s": 1.5,
    "2.0 s": 2.0,
    "3.0 s": 3.0,
    WHOLE: None,
}
"""When a classifier is asked: so long after the motion began, and at its end."""
EVERYTHING = "all"
"""All moments, or all kinds of nothing, together."""
