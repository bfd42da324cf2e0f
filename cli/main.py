"""The `autocomplete` command: one module a subcommand, loaded when it is asked for.

Exit code 0 done, 1 failed, 2 wrong usage; an error is one line on stderr.
"""

import argparse
import importlib
import sys
from typing import NoReturn

COMMANDS = {
    "demo": "everything on this machine, flown by a simulated operator",
    "up": "everything on this machine, for a person at the console or a pad",
    "run": "run one service, on this machine or any other",
    "router": "run a Zenoh router inside this process",
}


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line that points to the help."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and exit with 2."""
        sys.stderr.write(f"{self.prog}: {message} (see '{self.prog} --help')\n")
        raise SystemExit(2)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = Parser(
        prog="autocomplete",
        description="Start a motion with the sticks; the drone recognises it, draws it, flies it.",
        epilog="'autocomplete COMMAND --help' tells more of each.",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=text)
        if arguments[:1] == [name]:
            # Only the command that runs is imported: a service starts no faster than its imports.
            importlib.import_module(f"cli.{name}").declare(command)
    options = parser.parse_args(arguments)
    try:
        return int(options.action(options))
    except (ValueError, OSError) as error:
        sys.stderr.write(f"autocomplete {options.command}: {error}\n")
        return 2 if isinstance(error, ValueError) else 1
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
