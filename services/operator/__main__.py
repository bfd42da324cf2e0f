import sys

from cli.main import main

sys.exit(main(["run", "operator", *sys.argv[1:]]))
