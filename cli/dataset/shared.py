"""What the subcommands share: types of options, the extra they need, problems as lines."""

import argparse
import contextlib
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

PROBLEMS_SHOWN = 20
"""Of each file; a wrong option makes every row of a file a problem."""


@contextlib.contextmanager
def training_installed() -> Iterator[None]:
    """Tells how to get a package that an import inside lacks.

    Raises:
        OSError: if one is missing.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise OSError(
            f"{error.name} is missing; install it with pip install -e '.[training]'"
        ) from None


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
    told, command = before.get("made", ""), shlex.join(options.words)
    if f"; {told}".endswith(f"; {command}"):
        return dict(before)
    return {**before, "made": f"{told}; {command}" if told else command}


def tell(problems: Sequence[object]) -> None:
    """Write what was wrong with a file, a line each, to stderr."""
    for problem in problems[:PROBLEMS_SHOWN]:
        sys.stderr.write(f"{problem}\n")
    more = len(problems) - PROBLEMS_SHOWN
    if more > 0:
        sys.stderr.write(f"... and {more} more like these\n")
