import sys

from cli.main import main

sys.exit(main(["run", "autopilot", *sys.argv[1:]]))
