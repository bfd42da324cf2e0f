"""Draws the suggested path into the live picture, and serves the console."""
