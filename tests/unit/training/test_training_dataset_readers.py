"""Every shape of file gives the same sticks; bad rows are told one by one, and the rest is read."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dataset_samples import (
    CSV_BUTTONS,
    REST,
    UTC_NS,
    UTC_S,
    circle,
    joy_document,
    performed,
    primitive,
    write_csv,
    write_joy,
    write_sticks,
    write_vectors,
)

from training.dataset.axes import parse_axes
from training.dataset.lengths import PRESETS, Limit
from training.dataset.reading import Rules, format_of, read_file
from training.dataset.store import DatasetError, save
from training.labels import PRIMITIVES

WRITERS = {"csv": write_csv, "joy": write_joy, "mcap": write_sticks}
SESSION = performed(*((circle(), button) for button in CSV_BUTTONS))


@pytest.mark.parametrize("file_format", WRITERS)
def test_every_format_gives_the_sticks_with_the_label_of_the_button(
    tmp_path: Path, file_format: str
) -> None:
    path = WRITERS[file_format](tmp_path / "ana.txt", SESSION)
    assert format_of(path) == file_format
    reading = read_file(path, Rules())
    assert not reading.problems
    assert [p.label for p in reading.primitives] == list(PRIMITIVES)
    for found in reading.primitives:
        np.testing.assert_allclose(found.sticks, circle(), atol=1e-6)
        np.testing.assert_allclose(found.times_s, np.arange(150) / 50.0, atol=1e-6)
        assert (found.operator, found.source.split()[0]) == ("ana", "ana.txt")
    assert abs(reading.primitives[0].utc_ns - (UTC_NS + 200_000_000)) < 1000


def test_vectors_give_their_sticks_at_a_rate_without_their_padding(tmp_path: Path) -> None:
    after = np.concatenate([circle(), np.zeros((50, 4))])
    before = np.concatenate([np.zeros((50, 4)), circle()])
    path = write_vectors(tmp_path / "v.csv", [(circle(), 1), (after, 3), (before, 2)])
    assert format_of(path) == "vectors"
    reading = read_file(path, Rules(rate_hz=45.0))
    assert [p.label for p in reading.primitives] == ["arc", "helix", "sine"]
    for found in reading.primitives:
        np.testing.assert_allclose(found.sticks, circle())
        assert found.rate_hz == pytest.approx(45.0)


def test_vectors_name_their_integers_and_may_begin_with_a_header(tmp_path: Path) -> None:
    path = write_vectors(tmp_path / "v.csv", [(circle(), 1)])
    path.write_text("0,1,2\n" + path.read_text())
    reading = read_file(path, Rules(classes=("sine", "helix")))
    assert [p.label for p in reading.primitives] == ["helix"]


def test_the_order_of_axes_is_an_option(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", SESSION)
    turned = read_file(path, Rules(axes="vx,-vy,wz")).primitives[0]
    np.testing.assert_allclose(turned.sticks[:, 0], circle()[:, 1], atol=1e-6)
    np.testing.assert_allclose(turned.sticks[:, 1], -circle()[:, 0], atol=1e-6)
    assert parse_axes("vy,_,vx").sticks([1.0, 2.0, 3.0]) == (3.0, 1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "reason"), [("vx,vx", "named twice"), ("vx,up", "no stick 'up'"), ("", "no stick ''")]
)
def test_axes_that_are_none_are_refused(text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        parse_axes(text)


def problems_of(path: Path, rules: Rules | None = None) -> list[str]:
    reading = read_file(path, rules or Rules())
    assert all(str(problem).startswith(str(path)) for problem in reading.problems)
    assert all("\n" not in str(problem) for problem in reading.problems)
    return [str(problem).removeprefix(f"{path}: ") for problem in reading.problems]


def test_bad_rows_of_a_table_are_named_and_the_rest_is_read(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", SESSION)
    lines = path.read_text().splitlines()
    lines[20] = "spam"
    lines[30] = lines[30].replace(".", "x", 1)
    lines[40] = f"{UTC_S + 0.78},nan,0,0,0,0,0,0"
    lines[50] = f"{UTC_S + 0.98},1.7,0,0,0,0,0,0"
    lines[60] = lines[59]
    path.write_text("\n".join(lines))
    problems = problems_of(path)
    assert [problem.split(":")[0] for problem in problems] == [
        f"row {line + 1}" for line in (20, 30, 40, 50, 60)
    ]
    for problem, reason in zip(
        problems,
        (
            "'spam' is no number",
            "is no number",
            "not finite",
            "beyond [-1, 1]",
            f"time {UTC_S + 1}.160 s is not after",
        ),
        strict=True,
    ):
        assert reason in problem
    reading = read_file(path, Rules())
    assert [len(p) for p in reading.primitives] == [145, 150, 150, 150]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("secs,a,b,tri,cir,X,squ\n1,2\n", "row 1: no column c; the columns should be secs,a,b,c"),
        ("secs,a,b,c,tri,cir,X,squ\n", ""),
        ("secs,a,b,c,tri,cir,X,squ\n1,0.5\n", "row 2: column b is missing"),
    ],
)
def test_a_table_of_other_columns_is_told(tmp_path: Path, content: str, reason: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(content)
    problems = problems_of(path)
    assert (reason in problems[0]) if reason else not problems


def test_a_clock_set_back_begins_another_recording(tmp_path: Path) -> None:
    one, two = (write_csv(tmp_path / name, SESSION).read_text() for name in ("1.csv", "2.csv"))
    path = tmp_path / "both.csv"
    path.write_text(one + two.split("\n", 1)[1])
    reading = read_file(path, Rules())
    assert len(reading.primitives) == 8
    assert "beginning of another recording" in str(reading.problems[0])


def test_bad_documents_of_joy_are_named_and_the_rest_is_read(tmp_path: Path) -> None:
    documents = [joy_document(number, *row) for number, row in enumerate(SESSION)]
    documents[5] = "header: [\n"
    documents[6] = "just text\n"
    documents[7] = "axes: [0, 0, 0, 0]\n"
    documents[8] = documents[8].replace("secs", "hours")
    documents[9] = documents[9].replace("axes: [", "axes: [x, ")
    documents[10] = documents[10].replace("axes: [", f"axes: [{'9' * 400}, ")
    documents[12] = documents[12].replace("axes:", "axes: [0.1]\nother:")
    documents[-1] = documents[-1][: len(documents[-1]) // 2]
    path = tmp_path / "joy.yaml"
    path.write_text("---\n".join(documents))
    problems = problems_of(path)
    wrong = (5, 6, 7, 8, 9, 10, 12, len(documents) - 1)
    assert [int(problem.split()[1]) - 1 for problem in problems] == list(wrong)
    for problem, reason in zip(
        problems,
        (
            "no YAML",
            "no sensor_msgs/Joy",
            "header.stamp is missing",
            "lacks its secs or nsecs",
            "axes is no list of numbers",
            "int too large",
            "1 axes, but --axes names 4",
            "",
        ),
        strict=True,
    ):
        assert reason in problem
    assert len(read_file(path, Rules()).primitives) == 4


def test_joy_of_ros_2_is_read(tmp_path: Path) -> None:
    path = write_joy(tmp_path / "joy.yaml", SESSION)
    text = path.read_text().replace("nsecs", "nanosec").replace("secs", "sec")
    path.write_text(text)
    assert len(read_file(path, Rules()).primitives) == 4


def test_bad_rows_of_vectors_are_named_and_the_rest_is_read(tmp_path: Path) -> None:
    path = write_vectors(tmp_path / "v.csv", [(circle(), label) for label in (0, 1, 2, 3, 9, "x")])
    lines = path.read_text().splitlines()
    lines[1] = lines[1].replace("[", "(", 1)
    lines[2] = lines[2].replace("0.7", "7.7", 1)
    lines += ['"[0, 0, 0]",1', '"[0.1, 0.2]",1', ""]
    path.write_text("\n".join(lines))
    problems = problems_of(path)
    assert [int(problem.split()[1].rstrip(":")) for problem in problems] == [2, 3, 5, 6, 7, 8]
    for problem, reason in zip(
        problems,
        (
            "no [a, b, c]",
            "beyond [-1, 1]",
            "label 9 has no name",
            "its last cell 'x' should be its label",
            "no motion",
            "2 axes, but --axes names 3",
        ),
        strict=True,
    ):
        assert reason in problem
    assert [p.label for p in read_file(path, Rules()).primitives] == ["line", "helix"]


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_recording_that_is_cut_off_gives_what_was_written_before(
    tmp_path: Path, share: float
) -> None:
    path = write_sticks(tmp_path / "a.mcap", SESSION * 12)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    assert "cannot be read to its end" in problems_of(path)[0]


def test_what_is_no_recording_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    assert "no MCAP?" in problems_of(path)[0]
    write_sticks(path, [])
    assert "holds no sticks" in problems_of(path)[0]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"\n\n", "is empty"),
        (b"hello\n", "of no known format"),
        (b"\xff\xfe", "of no known format"),
    ],
)
def test_a_file_of_no_known_format_is_refused(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "a"
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=reason):
        read_file(path, Rules())


def test_sets_are_read_too(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save(path, [primitive(), primitive(operator="ben")])
    assert [p.operator for p in read_file(path, Rules()).primitives] == ["ana", "ben"]
    renamed = read_file(path, Rules(operator="eve", label="sine")).primitives
    assert [(p.operator, p.label) for p in renamed] == [("eve", "sine")] * 2


def test_what_no_button_labels_is_left_out_unless_the_label_is_given(tmp_path: Path) -> None:
    path = write_sticks(tmp_path / "a.mcap", performed((circle(), "end"), (circle(), "")))
    problems = problems_of(path)
    assert "button 'end' has no label" in problems[0]
    assert "no button ended it" in problems[1]
    reading = read_file(path, Rules(label="sine", idle_s=0.4))
    assert [p.label for p in reading.primitives] == ["sine", "sine"]
    named = read_file(path, Rules(buttons={"end": "helix"}))
    assert [p.label for p in named.primitives] == ["helix"]


def test_lengths_drop_pad_and_shorten_as_asked() -> None:
    thesis = PRESETS["thesis"]
    short, usual, long, endless = (primitive(sticks=circle(size)) for size in (44, 150, 300, 401))
    assert "shorter than 45 samples" in str(thesis.apply(short))
    assert "longer than 400 samples" in str(thesis.apply(endless))
    padded = thesis.apply(usual)
    assert len(padded) == 200
    assert not padded.sticks[150:].any()
    assert (np.diff(padded.times_s) > 0.0).all()
    newest = thesis.apply(long)
    np.testing.assert_array_equal(newest.sticks, long.sticks[100:])
    assert newest.times_s[0] == 0.0
    assert newest.utc_ns == UTC_NS + 2_000_000_000
    resampled = replace(thesis, over="resample").apply(long)
    assert len(resampled) == 200
    assert resampled.duration_s == pytest.approx(long.duration_s)
    assert "more than 200" in str(replace(thesis, over="drop").apply(long))
    assert PRESETS["ours"].apply(long) is long
    assert "shorter than 1 s" in str(PRESETS["ours"].apply(primitive(sticks=circle(40))))
    assert replace(thesis, shortest=Limit(4.0, is_time=True)).apply(usual) != usual


def test_rest_is_no_primitive_and_told_of(tmp_path: Path) -> None:
    path = write_sticks(tmp_path / "a.mcap", [(REST, "")] * 200 + [(REST, "cross")] * 5)
    reading = read_file(path, Rules())
    assert not reading.primitives
    (problem,) = reading.problems
    assert str(problem).startswith(f"{path}: no motion in its 205 samples: wrong --axes, or")
    (problem,) = problems_of(path, Rules(segmentation="thesis"))
    assert problem.startswith("no run of 90 rows with vx and vy off 0 in its 205 samples")


@pytest.mark.parametrize("file_format", [*WRITERS, "vectors"])
def test_damage_anywhere_is_told_in_lines_and_never_crashes(
    tmp_path: Path, file_format: str
) -> None:
    path = tmp_path / "a"
    if file_format == "vectors":
        write_vectors(path, [(circle(60), 1)] * 5)
    else:
        WRITERS[file_format](path, performed((circle(60), "cross")))
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole) - 30, 3):
            damaged[place] = rng.choice(list(b'09,.-[]{}"\n :e\x00\xffai&*!|'))
            del damaged[place + 1 : place + 1 + int(rng.integers(0, 5))]
        path.write_bytes(damaged)
        try:
            problems = read_file(path, Rules()).problems
        except DatasetError:
            continue
        assert not any("\n" in str(problem) for problem in problems)
