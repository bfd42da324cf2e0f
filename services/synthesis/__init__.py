"""From what the operator means to a path that continues it."""
