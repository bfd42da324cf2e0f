"""Results already found, so that a broken evaluation goes on where it stopped."""

import json
from pathlib import Path
from typing import Any


class Cache:
    """One JSON file a result, in one folder; a result of another mark is no result.

    Args:
        folder: where the files are; made when the first is kept.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def path(self, *names: object) -> Path:
        """The file of a result."""
        words = "-".join(str(name) for name in names)
        return self._folder / f"{words.replace(' ', '_').replace('+', 'and')}.json"

    def find(self, mark: str, *names: object) -> Any:
        """A result, or None if there is none of this mark."""
        try:
            kept = json.loads(self.path(*names).read_text())
        except (FileNotFoundError, json.JSONDecodeError):
            return None
        if not isinstance(kept, dict) or kept.get("mark") != mark:
            return None
        return kept.get("result")

    def keep(self, result: Any, mark: str, *names: object) -> None:
        """Write a result; a broken run leaves the old file or the new one, never half of one."""
        path = self.path(*names)
        path.parent.mkdir(parents=True, exist_ok=True)
        written = path.with_suffix(".part")
        written.write_text(json.dumps({"mark": mark, "result": result}))
        written.replace(path)
