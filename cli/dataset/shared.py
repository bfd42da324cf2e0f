"""What the subcommands share: types of options, problems as lines."""

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

PROBLEMS_SHOWN = 20
"""Of each file, on a terminal; a wrong option makes every row of a file a problem."""


def set_file(text: str) -> Path:
    """The path of a set.

    Raises:
        argparse.ArgumentTypeError: if it does not end in .npz.
    """
    path = Path(text)
    if path.suffix != ".npz" or path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: name a file that ends in .npz")
    return path


def word(text: str) -> str:
    """A name that is not empty.

    Raises:
        argparse.ArgumentTypeError: if it is.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty; write a name")
    return text.strip()


def add_people(parser: argparse.ArgumentParser, operator_help: str, *, required: bool) -> None:
    """Add --operator and --family."""
    parser.add_argument(
        "--operator", metavar="NAME", type=word, required=required, help=operator_help
    )
    parser.add_argument(
        "--family", metavar="NAME", default="", help="what kind of person that is (none)"
    )


def made(before: Mapping[str, str], options: argparse.Namespace) -> dict[str, str]:
    """A set's provenance after this command, which is told with all its options."""
    return joined(before, shlex.join(options.words))


def joined(before: Mapping[str, str], more: str) -> dict[str, str]:
    """A provenance with more of the commands that a set was made by."""
    told = before.get("made", "")
    if not more or f"; {told}".endswith(f"; {more}"):
        return dict(before)
    return {**before, "made": f"{told}; {more}" if told else more}


def tell(problems: Sequence[object]) -> None:
    """Write what was wrong with a file, a line each, to stderr: all of it, if that is a file."""
    shown = PROBLEMS_SHOWN if sys.stderr.isatty() else len(problems)
    for problem in problems[:shown]:
        sys.stderr.write(f"{problem}\n")
    more = len(problems) - shown
    if more > 0:
        sys.stderr.write(f"... and {more} more; 2> problems.txt writes all of them there\n")
