"""Runs the overlay: `python -m services.overlay`."""

import sys

from cli.main import main

sys.exit(main(["run", "overlay", *sys.argv[1:]]))
