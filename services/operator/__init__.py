"""The operator: a pad, a keyboard, the browser's pad or a simulated person; publishes `stick`."""
