import sys

from cli.main import main

sys.exit(main(["run", "classifier", *sys.argv[1:]]))
