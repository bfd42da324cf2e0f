"""Shapes beyond the four: found again from noisy points, and offered only where the four fail."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from synthesis_truth import S, intent, pose

from common.messages import FitRequest, Suggestion
from services.synthesis.config import Config
from services.synthesis.continuation import Vehicle, continue_from
from services.synthesis.core import RefusalError, Synthesizer
from services.synthesis.primitives import EXTENDED, PRIMITIVES
from services.synthesis.primitives.shape import UnfitError

EXTENDED_CONFIG = Config(primitives="extended", min_height_m=-1e3, max_height_m=1e3)
ENOUGH = {"spiral": 10.0, "eight": 1.3, "zigzag": 3.5, "compound": 2.4}
"""Extents, in each module's unit, that show a whole of each."""
SIGMA_M = {"spiral": 0.02, "eight": 0.02, "zigzag": 0.02, "compound": 0.005}
SHARE = {"spiral": 0.03, "eight": 0.03, "zigzag": 0.05, "compound": 0.25}
"""Largest error of a size as a share of itself, for 19 motions of 20."""
SIZES = {
    "spiral": ("radius", "growth"),
    "eight": ("length", "width"),
    "zigzag": ("length", "spacing"),
    "compound": ("length_1", "length_2"),
}
SPEED = 0.8


@pytest.mark.parametrize("name", list(EXTENDED))
def test_the_truth_is_found_from_noisy_points(name):
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(60):
        example = EXTENDED[name].example(rng, ENOUGH[name])
        points = example.points_m + rng.normal(0.0, SIGMA_M[name], example.points_m.shape)
        try:
            shape = EXTENDED[name].fit(points, example.points_m[-1])
            shape.check(EXTENDED_CONFIG)
        except UnfitError:
            errors.append(math.inf)
            continue
        assert set(shape.params) <= set(shape.figures)
        assert set(shape.stds) <= set(shape.params)
        assert set(shape.tolerances) <= set(shape.params)
        errors.append(
            max(abs(shape.params[size] / example.params[size] - 1.0) for size in SIZES[name])
        )
    assert np.percentile(errors, 95) <= SHARE[name]


@settings(max_examples=60, deadline=None)
@given(name=st.sampled_from(list(EXTENDED)), seed=st.integers(0, 10_000))
@example(name="eight", seed=2181)  # ends where it crosses itself
def test_the_path_starts_at_the_vehicle_goes_on_as_it_flies_and_has_no_kink(name, seed):
    rng = np.random.default_rng(seed)
    example = EXTENDED[name].example(rng, ENOUGH[name], 400)
    here = example.points_m[-1]
    travel = example.points_m[-1] - example.points_m[-2]
    shape = EXTENDED[name].fit(example.points_m, here)
    path = continue_from(shape, Vehicle(here, 0.0, travel / np.linalg.norm(travel)))[:, :3]
    assert np.allclose(path[0], here)
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assert 0.0 < lengths.min() <= lengths.max() < 0.25
    turns = np.sum(steps[1:] * steps[:-1], axis=1) / (lengths[1:] * lengths[:-1])
    assert turns.min() > math.cos(math.radians(30.0))
    assert steps[0] @ travel / lengths[0] / np.linalg.norm(travel) > math.cos(math.radians(10.0))
    assert len(path) <= 4096
    if shape.closed:
        assert np.array_equal(path[0], path[-1])


@pytest.mark.parametrize("name", ["spiral", "eight", "zigzag"])
def test_too_little_of_it_is_refused(name):
    rng = np.random.default_rng(6)
    for _ in range(20):
        example = EXTENDED[name].example(rng, 0.4 * ENOUGH[name])
        with pytest.raises(UnfitError):
            EXTENDED[name].fit(example.points_m, example.points_m[-1]).check(EXTENDED_CONFIG)


def test_segments_that_do_not_come_again_are_no_compound():
    turns = np.concatenate([np.zeros(40), np.full(20, 0.08), np.zeros(30), np.full(20, -0.05)])
    headings = np.cumsum(turns)
    xy = np.cumsum(0.1 * np.column_stack([np.cos(headings), np.sin(headings)]), axis=0)
    points = np.column_stack([xy, np.ones(len(xy))])
    with pytest.raises(UnfitError, match="make a round"):
        EXTENDED["compound"].fit(points, points[-1])


def suggested(primitive, extent, label, config=EXTENDED_CONFIG, seed=1):
    """What is said after a whole example was flown, but for its last 3 s."""
    rng = np.random.default_rng(seed)
    example = primitive.example(rng, extent, 2000)
    way = np.concatenate(
        [[0.0], np.cumsum(np.linalg.norm(np.diff(example.points_m, axis=0), axis=1))]
    )
    synthesizer = Synthesizer(config)
    for tick in range(round(100 * (way[-1] / SPEED - 3.0))):
        at = [np.interp(SPEED * tick / 100.0, way, axis) for axis in example.points_m.T]
        now_ns = S + tick * S // 100
        synthesizer.on_pose(pose(np.array(at) + rng.normal(0.0, 0.003, 3)), now_ns)
    return synthesizer.on_intent(intent(label, 4.0), now_ns)


@pytest.mark.parametrize(
    ("name", "extent", "label"),
    [("spiral", 10.0, "arc"), ("eight", 1.4, "arc"), ("zigzag", 3.9, "line")],
)
def test_what_the_four_cannot_explain_is_offered_by_geometry(name, extent, label):
    suggestion = suggested(EXTENDED[name], extent, label)
    assert isinstance(suggestion, Suggestion)
    assert suggestion.primitive == name
    assert "by the way flown" in suggestion.note


@pytest.mark.parametrize("name", list(PRIMITIVES))
def test_what_the_four_explain_stays_one_of_them(name):
    extent = {"line": 15.0, "arc": 12.0, "helix": 12.0, "sine": 4.0}[name]
    for seed in range(3):
        assert suggested(PRIMITIVES[name], extent, name, seed=seed).primitive == name


def test_the_thesis_preset_knows_none_of_them():
    thesis = Config(min_height_m=-1e3, max_height_m=1e3)
    said = suggested(EXTENDED["spiral"], 10.0, "arc", thesis)
    assert not isinstance(said, Suggestion) or said.primitive in PRIMITIVES
    request = FitRequest(primitive="spiral", points=[(float(i), 0.0, 1.0) for i in range(30)])
    with pytest.raises(RefusalError, match="unknown"):
        Synthesizer(thesis).fit(request, 0, S)


@pytest.mark.parametrize("name", list(EXTENDED))
def test_a_fit_can_be_asked_for(name):
    example = EXTENDED[name].example(np.random.default_rng(2), ENOUGH[name])
    points = [(float(x), float(y), float(z)) for x, y, z in example.points_m]
    request = FitRequest(primitive=name, points=points)
    suggestion = Synthesizer(EXTENDED_CONFIG).fit(request, 5, S)
    assert suggestion.primitive == name
    assert suggestion.path[0][:3] == pytest.approx(points[-1])


@pytest.mark.parametrize("name", list(EXTENDED))
@pytest.mark.parametrize(
    "points",
    [
        np.zeros((30, 3)),
        np.outer(np.arange(40.0), [1.0, 0.0, 0.0]),
        np.random.default_rng(0).normal(0.0, 1.0, (60, 3)),
    ],
    ids=["a point", "a line", "noise"],
)
def test_what_is_none_of_them_is_refused(name, points):
    request = FitRequest(primitive=name, points=[tuple(map(float, p)) for p in points])
    with pytest.raises(RefusalError):
        Synthesizer(EXTENDED_CONFIG).fit(request, 0, S)
