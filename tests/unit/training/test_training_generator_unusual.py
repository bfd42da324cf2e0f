import numpy as np
import pytest

from training.generator.people import FAMILIES, Style
from training.generator.unusual import OPPOSITE, WAYS, WAYS_EACH, draw_ways, unusual
from training.labels import PRIMITIVES


def test_ways_are_three_within_their_ranges_and_none_contradicts_another() -> None:
    ways = draw_ways(300, np.random.default_rng(0))
    names = list(WAYS)
    assert ((ways.strengths > 0.0).sum(axis=1) == WAYS_EACH).all()
    for column, (low, high) in enumerate(WAYS.values()):
        drawn = ways.strengths[:, column]
        drawn = drawn[drawn > 0.0]
        assert len(drawn) > 30
        assert low <= drawn.min()
        assert drawn.max() <= high
    for one, other in OPPOSITE.items():
        both = ways.strengths[:, [names.index(one), names.index(other)]]
        assert not (both > 0.0).all(axis=1).any()
    assert set(ways.sides.ravel()) == {-1.0, 1.0}


def test_the_same_seed_gives_the_same_unusual_people() -> None:
    one, again, other = (unusual(12, 2, seed) for seed in (1, 1, 2))
    assert len(one) == 12 * 2 * len(PRIMITIVES)
    for a, b in zip(one, again, strict=True):
        assert (a.operator, a.label) == (b.operator, b.label)
        assert np.array_equal(a.sticks, b.sticks)
        assert np.array_equal(a.times_s, b.times_s)
    assert any(len(a) != len(b) for a, b in zip(one, other, strict=True))
    assert [p.family for p in one if p.label == "line"][::2] == [
        family.name for style in Style for family in FAMILIES if family.style is style
    ]


def _ends_up(way: str, label: str, monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """Sticks of twelve people with this way alone."""
    from training.generator import unusual as module

    def only(n: int, rng: np.random.Generator) -> module.Ways:
        strengths = np.zeros((n, len(WAYS)))
        strengths[:, list(WAYS).index(way)] = rng.uniform(*WAYS[way], n)
        return module.Ways(strengths, np.ones((n, len(WAYS))))

    monkeypatch.setattr(module, "draw_ways", only)
    return [p.sticks for p in unusual(12, 5, 3) if p.label == label]


def test_who_rises_always_climbs_along(monkeypatch: pytest.MonkeyPatch) -> None:
    sticks = _ends_up("rising", "arc", monkeypatch)
    climbs = [track[:, 2].mean() > 0.02 for track in sticks]
    assert np.mean(climbs) > 0.8


def test_who_climbs_by_stairs_climbs_first(monkeypatch: pytest.MonkeyPatch) -> None:
    sticks = _ends_up("stairs", "helix", monkeypatch)
    earlier = []
    for track in sticks:
        up = np.abs(track[:, 2])
        earlier.append(up[: len(up) // 2].sum() > up[len(up) // 2 :].sum())
    assert np.mean(earlier) > 0.8


def test_who_brakes_ends_against_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    sticks = _ends_up("braking", "line", monkeypatch)
    against = [float(track[-1, :3] @ track[len(track) // 2, :3]) < 0.0 for track in sticks]
    assert np.mean(against) > 0.7
