"""Where a vehicle may fly unless somebody says otherwise: one default for all who keep to it."""

RADIUS_M = 100.0
"""Level distance from the world's origin."""
MIN_HEIGHT_M = 0.3
"""Of a path, above the world's origin."""
MAX_HEIGHT_M = 10.0
