"""The state machine as the docs show it, made from the code.

    python -m services.autopilot.diagram docs/autopilot.md

puts it between the page's two marks.
"""

import sys
from pathlib import Path

from services.autopilot.arbitration import ACTIONS, MODES, TABLE, Event

BEGIN = "<!-- the state machine: made by services/autopilot/diagram.py, do not edit -->"
END = "<!-- end of the state machine -->"


def markdown() -> str:
    """The diagram in Mermaid, and the table of every mode and every event."""
    edges: dict[tuple[str, str], list[str]] = {}
    for (mode, event), after in TABLE.items():
        if after is not None and (after != mode or event in ACTIONS):
            edges.setdefault((mode, after), []).append(event.value)
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> hover: start"]
    lines += [f"    {one} --> {other}: {', '.join(why)}" for (one, other), why in edges.items()]
    lines += ["```", ""]
    lines.append(f"| event | {' | '.join(MODES)} | the vehicle is told |")
    lines.append(f"|---|{'---|' * len(MODES)}---|")
    for event in Event:
        cells = " | ".join(TABLE[mode, event] or "-" for mode in MODES)
        lines.append(f"| `{event.value}` | {cells} | {ACTIONS.get(event, 'fly')} |")
    return "\n".join(lines)


def put_into(page: str) -> str:
    """A page with the present state machine between its marks.

    Raises:
        ValueError: if the marks are not there.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page lacks {BEGIN!r} or {END!r}")
    return f"{before}{BEGIN}\n\n{markdown()}\n\n{END}{after}"


if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(put_into(page.read_text()))
