"""One package a process; nothing is shared between them but the contract in common."""
