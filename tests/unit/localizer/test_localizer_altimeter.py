"""Which readings of the altimeter are believed."""

import pytest

from services.localizer.altimeter import AltimeterGate


@pytest.fixture
def gate() -> AltimeterGate:
    return AltimeterGate(noise_m=0.02, jump_m=0.15)


def test_a_jump_is_not_believed(gate):
    believed = gate.judge(1.05, 1.0, 0.01)
    assert believed == pytest.approx(0.05)
    assert gate.judge(0.8, 1.0, 0.01) is None
    assert gate.judge(1.2, 1.0, 0.01) is None
    assert gate.judge(1.0, 1.0, 0.01) is not None


def test_a_jump_is_believed_when_the_height_is_unknown(gate):
    believed = gate.judge(1.8, 1.0, 0.5)
    assert believed == pytest.approx(0.8)


def test_a_jump_that_stays_is_another_floor(gate):
    for _ in range(7):
        assert gate.judge(0.6, 1.0, 0.01) is None
        assert gate.in_doubt
        assert gate.floor_m == 0.0
    gate.judge(0.6, 1.0, 0.01)
    assert gate.floor_m == pytest.approx(0.4)
    believed = gate.judge(0.61, 1.0, 0.01)
    assert believed == pytest.approx(0.01)
    assert not gate.in_doubt


def test_back_on_the_ground_its_height_is_exact(gate):
    for _ in range(8):
        gate.judge(0.6, 1.0, 0.01)
    for _ in range(8):
        gate.judge(1.03, 1.0, 0.01)
    assert gate.floor_m == 0.0


def test_scattered_outliers_are_no_floor(gate):
    for index in range(40):
        gate.judge(0.3 if index % 2 else 2.5, 1.0, 0.01)
    assert gate.floor_m == 0.0
