"""What source files come to: a hash that comments, docstrings and formatting do not change."""

import ast
import hashlib
from functools import cache
from pathlib import Path

import training

ROOT = Path(training.__file__).parents[1]


@cache
def code_of(*patterns: str) -> str:
    """The hash of all files that match, in 16 hex digits.

    Args:
        patterns: paths and globs from the folder of the packages, like `training/svm.py`.

    Raises:
        FileNotFoundError: if a pattern matches nothing.
    """
    digest = hashlib.sha256()
    for pattern in patterns:
        paths = sorted(ROOT.glob(pattern))
        if not paths:
            raise FileNotFoundError(f"{pattern}: no such source file")
        for path in paths:
            digest.update(f"{path.relative_to(ROOT)} {_told(path.read_text())}\n".encode())
    return digest.hexdigest()[:16]


def _told(text: str) -> str:
    """The syntax tree without the strings that only explain."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [part for part in body if not _explains(part)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _explains(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
