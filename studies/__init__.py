"""What flights are measured by."""
