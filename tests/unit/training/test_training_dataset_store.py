"""The format on disk: what was saved is loaded, and what is no whole set says so in one line."""

import contextlib
import errno
import zipfile
from pathlib import Path

import numpy as np
import pytest
from dataset_samples import primitive
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from training.dataset.primitive import Primitive
from training.dataset.split import split_by_operator
from training.dataset.store import DatasetError, load, open_set, save
from training.labels import CLASSES

names = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=12)


@st.composite
def primitives(draw: st.DrawFn) -> Primitive:
    size = draw(st.integers(0, 12))
    steps = draw(hnp.arrays(np.float64, size, elements=st.floats(1e-3, 1.0)))
    sticks = draw(hnp.arrays(np.float32, (size, 4), elements=st.floats(-1.0, 1.0, width=32)))
    return Primitive(
        np.cumsum(steps) - (steps[0] if size else 0.0),
        sticks.astype(np.float64),
        draw(st.sampled_from(CLASSES)),
        draw(names),
        draw(names),
        draw(names),
        draw(st.integers(0, 2**62)),
    )


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(primitives(), max_size=5))
def test_what_was_saved_is_loaded(tmp_path: Path, saved: list[Primitive]) -> None:
    path = tmp_path / "set.npz"
    save(path, saved, {"made": "here"})
    loaded = load(path)
    assert len(loaded) == len(saved)
    for before, after in zip(saved, loaded, strict=True):
        np.testing.assert_array_equal(after.times_s, before.times_s)
        np.testing.assert_array_equal(after.sticks, before.sticks)
        for field in ("label", "operator", "family", "source", "utc_ns"):
            assert getattr(after, field) == getattr(before, field)
    assert open_set(path).provenance["made"] == "here"


def test_the_same_set_is_the_same_file(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        save(tmp_path / name, [primitive()])
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_file_cut_anywhere_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "set.npz"
    save(path, [primitive()])
    whole = path.read_bytes()
    for size in {0, 1, 3, 40, len(whole) // 3, len(whole) // 2, len(whole) - 1}:
        path.write_bytes(whole[:size])
        with pytest.raises(DatasetError, match=r"set\.npz is no data set"):
            load(path)


def test_a_damaged_file_is_refused_or_loaded_but_never_crashes(tmp_path: Path) -> None:
    path = tmp_path / "set.npz"
    save(path, [primitive()])
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(200):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 8):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        # Damage may hit a name or a padding byte; it may not raise anything else.
        with contextlib.suppress(DatasetError):
            load(path)


def rewritten(path: Path, **arrays: object) -> Path:
    save(path, [primitive(), primitive(operator="ben")])
    with np.load(path) as file:
        changed = {name: file[name] for name in file} | arrays
    np.savez(path, **{name: array for name, array in changed.items() if array is not None})
    return path


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"schema": np.int64(99)}, "has schema 99, this program reads 1"),
        ({"schema": None}, "is no data set"),
        ({"sticks": None}, "lacks its array sticks; import"),
        ({"sticks": np.zeros((3, 4))}, "sticks has shape"),
        ({"offsets": np.array([0, 400, 300])}, "offsets do not divide"),
        ({"times_s": np.full(300, "0")}, "times_s holds <U1"),
        ({"label": np.array(["arc", "spiral"])}, "row 1: label 'spiral' is unknown; use line"),
        ({"label": np.array(["arc", None], dtype=object)}, "is no data set"),
        ({"provenance": np.array("{")}, "is no data set"),
        ({"provenance": np.array("[1, 2]")}, "provenance is no JSON map"),
        ({"provenance": np.array("null")}, "provenance is no JSON map"),
    ],
)
def test_a_set_of_another_shape_is_refused(
    tmp_path: Path, arrays: dict[str, object], reason: str
) -> None:
    with pytest.raises(DatasetError, match=reason):
        load(rewritten(tmp_path / "set.npz", **arrays))


@pytest.mark.parametrize("content", [b"", b"secs,a,b\n", b"PK\x03\x04", b"\x93NUMPY"])
def test_what_is_no_set_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "set.npz"
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=r"set\.npz is no data set, or cut off; take"):
        load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("notes.txt", "hello")
    with pytest.raises(DatasetError, match="is no data set"):
        load(path)


def test_a_set_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(OSError, match="cannot be written"):
        save(Path("/proc/nowhere/set.npz"), [primitive()])
    path = tmp_path / "set.npz"
    save(path, [primitive()])

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match="No space left on device; choose another"):
        save(path, [primitive(), primitive()])
    assert len(load(path)) == 1
    assert [each.name for each in tmp_path.iterdir()] == ["set.npz"]


def test_a_primitive_of_unknown_label_or_shape_cannot_be() -> None:
    with pytest.raises(ValueError, match="'spiral' is unknown"):
        primitive(label="spiral")
    with pytest.raises(ValueError, match="should be"):
        primitive(times_s=np.zeros(3))


@given(st.integers(3, 60), st.integers(0, 5))
def test_sets_of_a_split_share_no_operator(operators: int, seed: int) -> None:
    everyone = [primitive(operator=f"p{number % operators}") for number in range(2 * operators)]
    split = split_by_operator(everyone, seed)
    people = [{p.operator for p in part} for part in (split.train, split.validation, split.test)]
    assert all(people)
    assert sum(map(len, people)) == len(set.union(*people)) == operators
    again = split_by_operator(everyone[::-1], seed)
    assert {p.operator for p in again.test} == people[2]


def test_two_operators_are_too_few_to_split() -> None:
    with pytest.raises(ValueError, match="2 operators are too few"):
        split_by_operator([primitive(), primitive(operator="ben")], 0)
