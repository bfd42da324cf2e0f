"""Writes what flies into an MCAP file."""
