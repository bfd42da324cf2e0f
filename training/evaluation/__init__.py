"""Evaluation: every classifier on the same people, windows and questions, against its bars."""
