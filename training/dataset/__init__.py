"""Labelled sticks: what is read, recorded and generated, in one format on disk."""
