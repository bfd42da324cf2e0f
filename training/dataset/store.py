"""The one format on disk: a compressed npz of samples laid end to end, with their provenance.

Arrays of schema 1, for n primitives of N samples together:
    schema        () int
    times_s       (N,) float64, each primitive from its own first sample
    sticks        (N, 4) float32: pads have 8 to 16 bits
    offsets       (n + 1,) int64: primitive i has the samples offsets[i] to offsets[i + 1]
    rate_hz       (n,) float32, mean
    utc_ns        (n,) int64, 0 where unknown
    label, operator, family, source    (n,) text
    provenance    () text: a JSON map of who made the file from what
"""

import contextlib
import errno
import json
import os
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from common.version import VERSION
from training.dataset.primitive import Primitive

SCHEMA = 1
WORDS = ("label", "operator", "family", "source")
KINDS = {"times_s": "f", "sticks": "f", "offsets": "i", "utc_ns": "i"}
"""Of numbers, as numpy calls them; the rest is text."""
ARRAYS = (*KINDS, *WORDS, "provenance")


class DatasetError(OSError):
    """A file that is no data set, or not a whole one; the text names it and says what to do."""


@dataclass(frozen=True)
class Stored:
    """A file's arrays, whole and of fitting shapes, but of whatever content.

    Attributes:
        path: where they are from.
        arrays: those of `ARRAYS`.
        provenance: who made the file from what.
    """

    path: Path
    arrays: dict[str, Any]
    provenance: dict[str, str]

    def __len__(self) -> int:
        """How many primitives there are."""
        return len(self.arrays["label"])

    def primitives(self) -> list[Primitive]:
        """All of them.

        Raises:
            DatasetError: if the label of one is unknown.
        """
        return [self.primitive(row) for row in range(len(self))]

    def primitive(self, row: int) -> Primitive:
        """The primitive of a row.

        Raises:
            DatasetError: if its label is unknown.
        """
        begin, end = self.arrays["offsets"][row : row + 2]
        label, operator, family, source = (str(self.arrays[word][row]) for word in WORDS)
        try:
            return Primitive(
                self.arrays["times_s"][begin:end],
                self.arrays["sticks"][begin:end].astype(np.float64),
                label,
                operator,
                family,
                source,
                int(self.arrays["utc_ns"][row]),
            )
        except ValueError as error:
            raise DatasetError(f"{self.path}: row {row}: {error}") from None


def save(
    path: Path, primitives: Sequence[Primitive], provenance: Mapping[str, str] | None = None
) -> None:
    """Write a data set; a file of that name is replaced only once the new one is whole.

    Args:
        path: where to.
        primitives: what.
        provenance: who made them from what; the version of this program is added.

    Raises:
        OSError: if it cannot be written.
    """
    lengths = [len(p) for p in primitives]
    arrays: dict[str, Any] = {
        "schema": np.int64(SCHEMA),
        "times_s": np.concatenate([np.zeros(0), *(p.times_s for p in primitives)]),
        "sticks": np.concatenate([np.zeros((0, 4)), *(p.sticks for p in primitives)]).astype(
            np.float32
        ),
        "offsets": np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        "rate_hz": np.array([p.rate_hz for p in primitives], dtype=np.float32),
        "utc_ns": np.array([p.utc_ns for p in primitives], dtype=np.int64),
        "provenance": np.array(
            json.dumps(dict(provenance or {}) | {"program": f"autocomplete {VERSION}"})
        ),
    }
    for word in WORDS:
        arrays[word] = np.array([getattr(p, word) for p in primitives], dtype=np.str_)
    partial = path.with_name(f".{path.name}.partial")
    require_place(path)
    try:
        with partial.open("wb") as stream:
            np.savez_compressed(stream, **arrays)
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise _unwritable(path, error) from None


def require_place(path: Path) -> None:
    """Make the folder of a data set to be written.

    Raises:
        OSError: if nothing can be written there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(path.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise _unwritable(path, error) from None


def _unwritable(path: Path, error: OSError) -> OSError:
    reason = error.strerror or str(error)
    return OSError(f"{path} cannot be written: {reason}; choose another --out")


def load(path: Path) -> list[Primitive]:
    """The primitives of a data set.

    Raises:
        DatasetError: if it is none, is cut off, or holds a label that is not known.
        OSError: if it cannot be read.
    """
    return open_set(path).primitives()


def open_set(path: Path) -> Stored:
    """A file's arrays, to be judged row by row.

    Raises:
        DatasetError: if it is no data set or is cut off.
        OSError: if it cannot be read.
    """
    if not path.is_file():
        raise DatasetError(f"{path}: no such file")
    with path.open("rb") as stream:
        if not zipfile.is_zipfile(stream):
            raise DatasetError(
                f"{path} is no data set, or cut off; take its backup or import its sources again"
            )
    try:
        with np.load(path, allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile) or "schema" not in file:
                raise DatasetError(
                    f"{path} is no data set; make one with 'autocomplete dataset import'"
                )
            schema = int(file["schema"])
            if schema != SCHEMA:
                raise DatasetError(
                    f"{path} has schema {schema}, this program reads {SCHEMA};"
                    " import its sources again"
                )
            missing = [name for name in ARRAYS if name not in file]
            if missing:
                raise DatasetError(
                    f"{path} lacks its array {', '.join(missing)}; import its sources again"
                )
            arrays = {name: file[name] for name in ARRAYS}
        provenance = json.loads(str(arrays.pop("provenance")))
    except DatasetError:
        raise
    # What zipfile, zlib and numpy raise for bytes that are broken is of many kinds.
    except Exception as error:
        raise DatasetError(
            f"{path} is no data set, or cut off ({' '.join(str(error).split())[:80]});"
            " take its backup or import its sources again"
        ) from None
    _require_shapes(path, arrays)
    if not isinstance(provenance, dict):
        raise DatasetError(f"{path}: provenance is no JSON map; import its sources again")
    return Stored(path, arrays, {str(k): str(v) for k, v in provenance.items()})


def _require_shapes(path: Path, arrays: dict[str, Any]) -> None:
    count = arrays["label"].size
    offsets = arrays["offsets"]
    samples = arrays["times_s"].size
    shapes = {
        "times_s": (samples,),
        "sticks": (samples, 4),
        "offsets": (count + 1,),
        "utc_ns": (count,),
        **dict.fromkeys(WORDS, (count,)),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise DatasetError(
                f"{path}: {name} has shape {arrays[name].shape}, not {shape};"
                " import its sources again"
            )
        if arrays[name].dtype.kind != KINDS.get(name, "U"):
            raise DatasetError(
                f"{path}: {name} holds {arrays[name].dtype}; import its sources again"
            )
    if offsets[0] != 0 or offsets[-1] != samples or (np.diff(offsets) < 0).any():
        raise DatasetError(f"{path}: offsets do not divide the samples; import its sources again")
