"""The model's file, watched: a new one is checked aside and taken between two windows.

Replace the file atomically (write beside it, then rename), or write it in place: it is read once
two looks in a row find it the same. A file that cannot be used is told of, and the old model stays.
"""

import threading
from pathlib import Path

from services.classifier.model import ModelError, OnnxModel

LOOK_PERIOD_S = 0.2

Signature = tuple[int, int, int]


class ModelFile:
    """A model and the file it is from.

    Args:
        path: the file.

    Attributes:
        model: the newest that could be used.
        fault: why the file as it is now is not `model`, or "".

    Raises:
        ModelError: if the file cannot be used.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._taken = self._seen = _signature(path)
        self.model = OnnxModel(path)
        self.fault = ""
        self._check: threading.Thread | None = None
        self._outcome: OnnxModel | ModelError

    @property
    def is_checking(self) -> bool:
        """Whether a new file is being read."""
        return self._check is not None and self._check.is_alive()

    def look(self) -> None:
        """See whether the file is another one, and take what was found good since the last look.

        Costs one `stat`; a file is read and checked on a thread of its own (ONNX Runtime lets the
        others run meanwhile), which takes some 20 ms.
        """
        if self.is_checking:
            return
        if self._check is not None:
            self._check = None
            if isinstance(self._outcome, OnnxModel):
                self.model, self.fault = self._outcome, ""
            else:
                self.fault = str(self._outcome)
        now = _signature(self._path)
        settled = now == self._seen
        self._seen = now
        if settled and now != self._taken:
            self._taken = now
            self._outcome = ModelError(f"model {self._path}: could not be checked, see the log")
            self._check = threading.Thread(target=self._read, name="model", daemon=True)
            self._check.start()

    def _read(self) -> None:
        try:
            self._outcome = OnnxModel(self._path)
        except ModelError as error:
            self._outcome = error


def _signature(path: Path) -> Signature | None:
    """What changes with a file: its inode, size and time; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns
