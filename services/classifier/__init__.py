"""Which primitive the sticks have begun, or none."""
