import sys

from cli.main import main

sys.exit(main(["run", "sim", *sys.argv[1:]]))
