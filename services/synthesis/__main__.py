import sys

from cli.main import main

sys.exit(main(["run", "synthesis", *sys.argv[1:]]))
