"""`autocomplete dataset`: files in, sets, tables and figures out, errors in one line."""

from pathlib import Path

import numpy as np
import pytest
from dataset_samples import circle, performed, primitive, write_csv, write_sticks, write_vectors

from cli.dataset.shared import PROBLEMS_SHOWN
from cli.main import main
from training.dataset.store import load, open_set, save


def dataset(*words: object) -> int:
    return main(["dataset", *map(str, words)])


def test_import_joins_files_and_tells_what_was_wrong_with_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = write_sticks(tmp_path / "ana.mcap", performed((circle(), "circle")))
    bad = write_csv(tmp_path / "ben.csv", performed((circle(), "cross"), (circle(30), "square")))
    bad.write_text(bad.read_text() + "spam\n")
    empty = tmp_path / "empty.csv"
    empty.touch()
    out = tmp_path / "set.npz"
    assert dataset("import", good, bad, empty, "--out", out) == 0
    assert [(p.label, p.operator) for p in load(out)] == [("arc", "ana"), ("sine", "ben")]
    told = capsys.readouterr().err
    assert f"{bad}: row 272: column secs: 'spam' is no number; the row is left out\n" in told
    assert "shorter than 1 s; dropped" in told
    assert f"{empty} is empty" in told.splitlines()


def test_import_replaces_no_set_but_adds_to_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_sticks(tmp_path / "ana.mcap", performed((circle(), "circle")))
    out = tmp_path / "set.npz"
    assert dataset("import", path, "--out", out) == 0
    assert dataset("import", path, "--out", out) == 1
    assert "is there already; choose another --out, or --append" in capsys.readouterr().err
    assert dataset("import", path, "--out", out, "--append", "--operator", "ben") == 0
    assert [p.operator for p in load(out)] == ["ana", "ben"]
    assert open_set(out).provenance["made"] == (
        f"import {path} --out {out}; import {path} --out {out} --append --operator ben"
    )


def test_a_set_of_sets_says_how_each_of_them_was_made(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", performed((circle(), "circle")))
    out, again = tmp_path / "set.npz", tmp_path / "again.npz"
    assert dataset("import", path, "--out", out) == 0
    assert dataset("import", out, "--out", again) == 0
    made = open_set(again).provenance["made"]
    assert made == f"import {path} --out {out}; import {out} --out {again}"


def test_import_leaves_out_what_check_finds_fault_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "a.npz", tmp_path / "sound.npz"
    hung = primitive(sticks=np.full((150, 4), 0.4), source="hung.csv")
    save(path, [primitive(), hung, primitive(source="twice.csv")])
    assert dataset("import", path, "--out", out, "--sound") == 0
    assert [p.source for p in load(out)] == ["test"]
    told = capsys.readouterr().err
    assert "hung.csv: arc by ana: every sample is the same: a pad that hangs?; left out\n" in told
    assert "twice.csv: arc by ana: the same sticks as row 0; keep one; left out\n" in told
    assert dataset("check", out) == 0
    save(path, [hung])
    assert dataset("import", path, "--out", tmp_path / "b.npz", "--sound") == 1
    assert "nothing was written" in capsys.readouterr().err


def test_a_file_gets_all_problems_and_a_terminal_the_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_csv(tmp_path / "a.csv", performed((circle(), "circle")))
    path.write_text(path.read_text() + "spam\n" * 30)
    assert dataset("import", path, "--out", tmp_path / "a.npz") == 0
    assert capsys.readouterr().err.count("'spam' is no number") == 30
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert dataset("import", path, "--out", tmp_path / "b.npz") == 0
    told = capsys.readouterr().err
    assert told.count("'spam' is no number") == PROBLEMS_SHOWN
    assert "... and 10 more; 2> problems.txt writes all of them there\n" in told


def test_a_set_says_with_which_options_it_was_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_csv(tmp_path / "a.csv", performed((circle(), "circle")))
    out = tmp_path / "set.npz"
    options = ("--label", "sine", "--axes", "vx,vy,vz", "--segmentation", "ours", "--idle", "0.5")
    assert dataset("import", path, "--out", out, *options) == 0
    assert dataset("stats", out) == 0
    assert f"made: import {path} --out {out} {' '.join(options)}, program: " in (
        capsys.readouterr().out
    )


def test_the_preset_of_the_thesis_pads_to_200(tmp_path: Path) -> None:
    path = write_vectors(tmp_path / "v.csv", [(circle(size), 1) for size in (44, 150, 300, 401)])
    out = tmp_path / "set.npz"
    assert dataset("import", path, "--out", out, "--preset", "thesis") == 0
    assert [len(p) for p in load(out)] == [200, 200]
    other = ("--shortest", "0.5s", "--longest", "400", "--length", "200", "--over", "drop")
    assert dataset("import", path, "--out", tmp_path / "b.npz", *other) == 0
    assert [len(p) for p in load(tmp_path / "b.npz")] == [44, 150]


def test_nothing_usable_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    path.write_text("hello\n")
    assert dataset("import", path, "--out", tmp_path / "a.npz") == 1
    assert "nothing was written" in capsys.readouterr().err
    assert not (tmp_path / "a.npz").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--axes", "up"], "argument --axes: no stick 'up'"),
        (["--buttons", "cross"], "argument --buttons: 'cross': write BUTTON=LABEL"),
        (["--buttons", "cross=loop"], "argument --buttons: no label 'loop'; there are line"),
        (["--classes", "loop"], "argument --classes: no label 'loop'"),
        (["--rate", "0"], "argument --rate: '0': use Hz"),
        (["--shortest", "x"], "argument --shortest: 'x': use samples"),
        (["--label", "loop"], "argument --label: invalid choice: 'loop'"),
        (["--operator", " "], "argument --operator: it is empty"),
        (["--out", "set.csv"], "argument --out: set.csv: name a file that ends in .npz"),
    ],
)
def test_wrong_usage_exits_with_2_and_names_the_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], reason: str
) -> None:
    path = write_csv(tmp_path / "a.csv", performed((circle(), "circle")))
    with pytest.raises(SystemExit) as exit_:
        dataset("import", path, "--out", tmp_path / "a.npz", *words)
    assert exit_.value.code == 2
    assert reason in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--over", "drop"], "--over and --pad need a --length"),
        (["--ignored-is-none"], "--ignored-is-none goes with --from-flights"),
        (["--from-flights", "--label", "arc"], "--label says nothing of --from-flights"),
        (["--from-flights", "--idle", "2"], "--idle says nothing of --from-flights"),
        (["--from-flights", "--format", "joy"], "--format says nothing of --from-flights"),
        (["--from-flights", "--segmentation", "thesis"], "--segmentation says nothing of"),
        (["--shortest", "400", "--longest", "45"], "--shortest 400 samples is more than --longest"),
    ],
)
def test_options_that_need_others_say_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], reason: str
) -> None:
    path = write_csv(tmp_path / "a.csv", performed((circle(), "circle")))
    assert dataset("import", path, "--out", tmp_path / "a.npz", *words) == 2
    assert reason in capsys.readouterr().err


def test_check_tells_each_finding_and_its_exit_code_tells_whether_there_is_any(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sound, faulty, broken = (tmp_path / name for name in ("a.npz", "b.npz", "c.npz"))
    save(sound, [primitive()])
    save(faulty, [primitive(), primitive(times_s=5.0 * np.arange(150) / 50.0)])
    broken.write_bytes(sound.read_bytes()[:100])
    assert dataset("check", sound) == 0
    assert "1 primitives, nothing is wrong" in capsys.readouterr().out
    assert dataset("check", sound, faulty, broken) == 1
    lines = capsys.readouterr().out.splitlines()
    assert f"{faulty}: row 1: arc by ana: 10.0 Hz is outside 20 to 100 Hz" in lines
    assert any(line.startswith(f"{broken} is no data set, or cut off") for line in lines)


def test_stats_count_and_draw(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, figure = tmp_path / "a.npz", tmp_path / "a.png"
    save(path, [primitive(), primitive(label="sine", operator="ben"), primitive(label="none")])
    assert dataset("stats", path, "--figure", figure) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["arc", "1", "1", "150", "/", "150", "/", "150"] in [line[:8] for line in lines]
    assert ["ben", "1", "0", "0", "1", "0", "0", "150", "50"] in lines
    assert figure.read_bytes().startswith(b"\x89PNG")
    names = ["wide0-pilot-strafe-rough-0012", "[/ana]"]
    save(path, [primitive(operator=name, family="[b]") for name in names])
    assert dataset("stats", path) == 0
    words = capsys.readouterr().out.split()
    assert {*names, "[b]"} <= set(words)
    save(path, [])
    assert dataset("stats", path) == 1
    assert dataset("stats", figure) == 1


@pytest.mark.parametrize("name", ["lengths", "lengths.xyz", "."])
def test_a_figure_of_no_known_kind_is_refused_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    path = tmp_path / "a.npz"
    save(path, [primitive()])
    with pytest.raises(SystemExit) as exit_:
        dataset("stats", path, "--figure", name)
    assert exit_.value.code == 2
    assert "name a file that ends in .png, .pdf, .svg" in capsys.readouterr().err
    assert dataset("stats", path, "--figure", path / "a.png") == 1
    assert "a.png cannot be written" in capsys.readouterr().err


def test_split_deals_whole_operators(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.npz"
    save(path, [primitive(operator=f"p{number % 5}") for number in range(10)])
    assert dataset("split", path) == 0
    parts = [load(tmp_path / f"a.{name}.npz") for name in ("train", "validation", "test")]
    assert [len(part) for part in parts] == [6, 2, 2]
    save(path, [primitive()])
    assert dataset("split", path) == 2
    assert "1 operators are too few" in capsys.readouterr().err


def test_generate_makes_the_same_set_for_the_same_seed(tmp_path: Path) -> None:
    small = ("--operators", 3, "--multiple", 0.004, "--none", 3, "--seed", 7)
    for name in ("a.npz", "b.npz"):
        assert dataset("generate", "--out", tmp_path / name, *small) == 0
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    found = load(tmp_path / "a.npz")
    assert {p.label for p in found} == {"line", "arc", "sine", "helix", "none"}
    assert len({p.operator for p in found}) == 3
    assert dataset("check", tmp_path / "a.npz") == 0
    made = open_set(tmp_path / "a.npz").provenance["made"]
    assert made == "generate --preset wide --operators 3 --multiple 0.004 --none 3 --seed 7"


def test_generate_replaces_no_set_and_counts_who_performs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.npz"
    small = ("--operators", 3, "--multiple", 0.001)
    assert dataset("generate", "--out", out, *small) == 0
    assert capsys.readouterr().out == f"{out}: 4 primitives by 1 operators\n"
    whole = out.read_bytes()
    assert dataset("generate", "--out", out, *small, "--seed", 1) == 1
    assert "is there already; choose another --out" in capsys.readouterr().err
    assert out.read_bytes() == whole


def test_people_of_other_seeds_have_other_names(tmp_path: Path) -> None:
    for seed in (0, 1):
        small = ("--operators", 2, "--multiple", 0.002, "--seed", seed)
        assert dataset("generate", "--out", tmp_path / f"{seed}.npz", *small) == 0
    one, other = ({p.operator for p in load(tmp_path / f"{seed}.npz")} for seed in (0, 1))
    assert not one & other


def test_generate_makes_the_population_of_the_thesis(tmp_path: Path) -> None:
    out = tmp_path / "a.npz"
    assert dataset("generate", "--out", out, "--preset", "thesis", "--multiple", 0.004) == 0
    assert {p.source for p in load(out)} == {"generator thesis seed 0"}


@pytest.mark.parametrize("command", ["import", "record", "generate", "stats", "check", "split"])
def test_help_teaches_by_examples(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        dataset(command, "--help")
    assert exit_.value.code == 0
    assert f"autocomplete dataset {command} " in capsys.readouterr().out.split("examples:")[1]
