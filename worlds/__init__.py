"""Worlds: one YAML a world under this folder, read by the simulator, operators and studies."""
