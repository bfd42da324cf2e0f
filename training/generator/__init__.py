"""Sticks of simulated operators: pure, and the same for the same seed."""
