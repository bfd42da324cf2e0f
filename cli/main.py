"""The `autocomplete` command: one module a subcommand, loaded when it is asked for.

Exit code 0 done, 1 failed, 2 wrong usage; an error is one line on stderr.
"""

import argparse
import importlib
import os
import sys
from typing import NoReturn

COMMANDS = {
    "demo": "everything on this machine, flown by a simulated operator",
    "up": "everything on this machine, for a person at the console or a pad",
    "run": "run one service, on this machine or any other",
    "router": "run a Zenoh router inside this process",
    "topics": "the contract's table with live rates",
    "echo": "a topic's messages as they come",
    "alive": "whether a service runs, by the exit code",
    "doctor": "what is installed, reachable and alive, and what to do about what is not",
    "record": "what flies, into an MCAP file",
    "dataset": "labelled sticks: import, record, generate, stats, check, split",
    "worlds": "the places to fly in, and pictures of them",
    "contract": "print the wire contract, made from the code",
    "train": "make the model that recognises primitives, and its card",
    "evaluate": "every classifier on the same people, against the bars, as a report",
}

DEBUG = "AUTOCOMPLETE_DEBUG"
"""Set to 1, an error is shown with its traceback."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line that points to the help.

    Attributes:
        words: what follows the command, for options that depend on other words.
    """

    words: tuple[str, ...] = ()

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and exit with 2."""
        sys.stderr.write(f"{self.prog}: {message} (see '{self.prog} --help')\n")
        raise SystemExit(2)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        return _run(arguments)
    except BrokenPipeError:
        # The reader of a pipe has left; nothing is to be flushed to it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        # Of what runs until it is stopped, no signal comes as far as this.
        sys.stderr.write(f"autocomplete {arguments[0]}: stopped\n")
        return 1
    except Exception as error:
        if os.environ.get(DEBUG):
            raise
        text = next(iter(str(error).splitlines()), "")
        if not isinstance(error, ValueError | OSError):
            text = f"{type(error).__name__}: {text} ({DEBUG}=1 shows where)"
        sys.stderr.write(f"autocomplete {arguments[0]}: {text}\n")
        return 2 if isinstance(error, ValueError) else 1


def _run(arguments: list[str]) -> int:
    parser = Parser(
        prog="autocomplete",
        description="Start a motion with the sticks; the drone recognises it, draws it, flies it.",
        epilog="'autocomplete COMMAND --help' tells more of each.",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=text)
        if arguments[:1] == [name]:
            command.words = tuple(arguments[1:])
            # Only the command that runs is imported: a service starts no faster than its imports.
            importlib.import_module(f"cli.{name}").declare(command)
    options = parser.parse_args(arguments)
    return int(options.action(options))


if __name__ == "__main__":
    sys.exit(main())
