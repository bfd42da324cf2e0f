"""Every fault of a set is found, and a sound one has none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dataset_samples import circle, primitive

from training.dataset.check import check, check_stored, load_sound
from training.dataset.primitive import Primitive
from training.dataset.store import DatasetError, open_set, save

TIMES_S = np.arange(150) / 50.0


def with_times(index: int, value: float) -> np.ndarray:
    times_s = TIMES_S.copy()
    times_s[index] = value
    return times_s


def with_stick(value: float) -> np.ndarray:
    sticks = circle()
    sticks[7, 1] = value
    return sticks


def gapped() -> np.ndarray:
    return np.where(np.arange(150) < 70, TIMES_S, TIMES_S + 0.9)


FAULTS = {
    "0 samples are no motion": primitive(sticks=np.zeros((0, 4))),
    "it names no operator": primitive(operator=" "),
    "1 samples are not finite, first 7": primitive(sticks=with_stick(np.nan)),
    "1 samples are not finite, first 3": primitive(times_s=with_times(3, np.inf)),
    "times do not rise at 1 samples, first 4": primitive(times_s=with_times(4, TIMES_S[3])),
    "times begin at 1 s": primitive(times_s=TIMES_S + 1.0),
    "1 samples are beyond [-1, 1], first 7": primitive(sticks=with_stick(-1.5)),
    "is shorter than 1 s": primitive(sticks=circle(40)),
    "10.0 Hz is outside 20 to 100 Hz": primitive(times_s=5.0 * TIMES_S),
    "1 gaps of more than 0.5 s, the longest 0.92 s after sample 69": primitive(times_s=gapped()),
    "the sticks rest all the time, which is no arc": primitive(sticks=np.zeros((150, 4))),
    "every sample is the same": primitive(sticks=np.full((150, 4), 0.4)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found_alone(fault: str) -> None:
    sound = primitive()
    findings = check([sound, FAULTS[fault]])
    told = [str(finding) for finding in findings if "the same sticks" not in finding.text]
    assert len(told) == 1
    assert fault in told[0]
    assert told[0].startswith("row 1: arc by")


def tilted(angle_rad: float, **changes: object) -> Primitive:
    vx, vy, *rest = circle().T
    turned = (
        vx * np.cos(angle_rad) - vy * np.sin(angle_rad),
        vx * np.sin(angle_rad) + vy * np.cos(angle_rad),
    )
    return primitive(sticks=np.stack([*turned, *rest], axis=1), **changes)


def test_a_sound_set_has_no_fault() -> None:
    assert check([tilted(0.1 * number) for number in range(6)]) == []
    rest = primitive(sticks=np.zeros((150, 4)), label="none")
    assert check([tilted(0.0), rest, rest]) == []


def test_the_same_sticks_twice_are_found_with_their_labels() -> None:
    findings = check([tilted(0.0), tilted(1.0), tilted(1.0, label="sine")])
    assert [str(finding) for finding in findings] == [
        "row 2: sine by ana: the same sticks as row 1 but called arc; keep one"
    ]


def test_an_axis_that_never_moves_is_found_by_operator() -> None:
    flat = [
        replace(tilted(0.1 * number), sticks=tilted(0.1 * number).sticks * [1.0, 0.0, 1.0, 1.0])
        for number in range(6)
    ]
    others = [tilted(0.1 * number, operator="ben") for number in range(6)]
    assert [str(finding) for finding in check([*flat, *others])] == [
        "operator ana: vy never moves in 6 primitives; a dead axis, or wrong --axes"
    ]
    helices = [tilted(0.1 * number, label="helix") for number in range(6)]
    assert "vz never moves" in str(check(helices)[0])


def test_rows_of_a_file_keep_their_numbers(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save(path, [tilted(0.0), tilted(1.0), tilted(2.0), tilted(2.0)])
    with np.load(path) as file:
        arrays = dict(file)
    arrays["label"] = np.array(["arc", "spiral", "arc", "arc"])
    np.savez(path, **arrays)
    findings = [str(finding) for finding in check_stored(open_set(path))]
    assert findings == [
        "row 1: label 'spiral' is unknown; use line, arc, sine, helix, none",
        "row 3: arc by ana: the same sticks as row 2; keep one",
    ]
    sound, told = load_sound(path)
    assert [len(sound), len(told)] == [2, 2]
    save(path, [])
    assert "there is no primitive" in str(check_stored(open_set(path))[0])
    with pytest.raises(DatasetError, match="none of its 0 primitives can be used"):
        load_sound(path)
