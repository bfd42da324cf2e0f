import sys

from cli.main import main

sys.exit(main(["run", "recorder", *sys.argv[1:]]))
