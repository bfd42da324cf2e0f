"""A table, as Markdown and as HTML."""

import html
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Text in rows and columns.

    Attributes:
        title: above it.
        caption: below it: what was counted, and how often.
        header: of the columns.
        rows: as long as the header.
    """

    title: str
    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """For docs."""
        lines = [f"## {self.title}", "", _line(self.header), _line(["---"] * len(self.header))]
        lines += [_line(row) for row in self.rows]
        return "\n".join([*lines, "", self.caption, ""])

    def html(self) -> str:
        """For a browser; cells that begin with "met" or "short" are coloured."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.header)
        body = "".join(
            "<tr>" + "".join(f"<td{_mark(cell)}>{html.escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        return (
            f"<h2>{html.escape(self.title)}</h2><table><tr>{head}</tr>{body}</table>"
            f"<p>{html.escape(self.caption)}</p>"
        )


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def is_met(cell: str) -> bool | None:
    """Whether a cell is a verdict, and which."""
    if cell == "met" or cell.startswith("met "):
        return True
    return False if cell.startswith(("short", "over", "not met")) else None


def _mark(cell: str) -> str:
    met = is_met(cell)
    return "" if met is None else f' class="{"met" if met else "short"}"'
