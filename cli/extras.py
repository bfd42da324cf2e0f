"""Packages that only some commands need: they are extras of pyproject.toml."""

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path(__file__).parents[1]
"""The project's."""


def installs(extra: str) -> str:
    """What is typed in the project's folder to install an extra for this Python."""
    pip = Path(sys.executable).with_name("pip")
    typed = pip.relative_to(FOLDER) if pip.is_relative_to(FOLDER) else pip
    return f"{typed} install -c constraints.txt -e '.[{extra}]'"


@contextlib.contextmanager
def needing(extra: str) -> Iterator[None]:
    """Tells how to get a package that an import inside lacks.

    Raises:
        OSError: if one is missing.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise OSError(f"{error.name} is missing: {installs(extra)}") from None
