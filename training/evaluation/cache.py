"""Results already found, so that a broken evaluation goes on where it stopped."""

import json
from pathlib import Path
from typing import Any


class Cache:
    """One JSON file a result, in one folder; a result of other data is no result.

    Args:
        folder: where the files are.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, *names: object) -> Path:
        """The file of a result."""
        words = "-".join(str(name) for name in names)
        return self._folder / f"{words.replace(' ', '_').replace('+', 'and')}.json"

    def find(self, fingerprint: str, *names: object) -> dict[str, Any] | None:
        """A result, or None if there is none of this data."""
        path = self.path(*names)
        try:
            found = json.loads(path.read_text())
        except (FileNotFoundError, json.JSONDecodeError):
            return None
        if not isinstance(found, dict) or found.get("fingerprint") != fingerprint:
            return None
        return found

    def keep(self, result: dict[str, Any], fingerprint: str, *names: object) -> None:
        """Write a result; a broken run leaves the old file or the new one, never half of one."""
        path = self.path(*names)
        written = path.with_suffix(".part")
        written.write_text(json.dumps({"fingerprint": fingerprint, **result}))
        written.replace(path)
