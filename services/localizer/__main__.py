import sys

from cli.main import main

sys.exit(main(["run", "localizer", *sys.argv[1:]]))
