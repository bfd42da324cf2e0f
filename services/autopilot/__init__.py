"""Who flies: the operator's sticks or the path they accepted."""
