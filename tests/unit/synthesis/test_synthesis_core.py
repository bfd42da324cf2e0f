"""From intents and poses to suggestions, or to reasons for none."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_truth import S, arc_points, intent, noisy, pose, poses, sine_points

from common.messages import FitRequest, Refusal, Suggestion, VehicleStatus
from services.synthesis.config import Config
from services.synthesis.core import RefusalError, Synthesizer

CENTRE = np.array([0.0, 4.0])
RADIUS, SPEED = 4.0, 0.9


def along_circle(length_m):
    angle = length_m / RADIUS - math.pi / 2.0
    return np.array([*(CENTRE + RADIUS * np.array([math.cos(angle), math.sin(angle)])), 1.0])


def flown(where, duration_s, yaw=0.0):
    synthesizer, last_ns = Synthesizer(Config()), 0
    for message, arrival_ns in poses(where, duration_s, yaw):
        synthesizer.on_pose(message, arrival_ns)
        last_ns = arrival_ns
    return synthesizer, last_ns


def straight_then_curve(t, straight_s):
    way = SPEED * (t - straight_s)
    return np.array([way, 0.0, 1.0]) if way < 0.0 else along_circle(way)


def wobbling(where, seed=0, sigma_m=0.003):
    rng = np.random.default_rng(seed)
    return lambda t: where(t) + rng.normal(0.0, sigma_m, 3)


def test_a_flown_curve_becomes_a_circle_that_starts_at_the_vehicle():
    synthesizer, now_ns = flown(wobbling(lambda t: along_circle(SPEED * t)), 4.0)
    suggestion = synthesizer.on_intent(intent("arc", 4.0), now_ns)
    assert suggestion.primitive == "arc"
    assert suggestion.closed
    assert suggestion.params["radius"] == pytest.approx(RADIUS, rel=0.05)
    assert suggestion.params["cy"] == pytest.approx(4.0, abs=0.2)
    assert suggestion.params["sweep"] == pytest.approx(2.0 * math.pi)
    assert suggestion.path[0][:3] == pytest.approx(along_circle(SPEED * 4.0), abs=0.02)
    assert suggestion.speed == pytest.approx(SPEED, abs=0.05)
    assert 0.0 < suggestion.confidence <= 0.9
    assert suggestion.fit_rms < 0.02


def test_a_window_that_begins_straight_still_gives_the_curve():
    for straight_s in (1.0, 1.5, 2.0):
        where = wobbling(lambda t, straight_s=straight_s: straight_then_curve(t, straight_s))
        synthesizer, now_ns = flown(where, straight_s + 2.5)
        suggestion = synthesizer.on_intent(intent("arc", 4.0), now_ns)
        assert suggestion is not None, synthesizer.last_refusal
        assert suggestion.primitive == "arc"
        assert suggestion.params["radius"] == pytest.approx(RADIUS, rel=0.2)


def test_a_window_that_begins_curved_still_gives_the_line():
    where = wobbling(lambda t: along_circle(SPEED * t) if t < 2.0 else after_curve(t - 2.0))
    synthesizer, now_ns = flown(where, 4.0)
    suggestion = synthesizer.on_intent(intent("line", 4.0), now_ns)
    assert suggestion.primitive == "line"
    assert suggestion.params["heading"] == pytest.approx(2.0 * SPEED / RADIUS, abs=0.03)


def after_curve(t):
    heading = 2.0 * SPEED / RADIUS
    way = SPEED * t * np.array([math.cos(heading), math.sin(heading), 0.0])
    return along_circle(2.0 * SPEED) + way


def test_an_arc_that_is_straight_becomes_a_less_confident_line():
    synthesizer, now_ns = flown(wobbling(lambda t: np.array([SPEED * t, 0.0, 1.0])), 3.0)
    line = synthesizer.on_intent(intent("line", 3.0), now_ns)
    instead = synthesizer.on_intent(intent("arc", 3.0), now_ns)
    assert instead.primitive == "line"
    assert instead.confidence == pytest.approx(line.confidence / 2.0)


def test_a_level_helix_becomes_an_arc():
    synthesizer, now_ns = flown(wobbling(lambda t: along_circle(SPEED * t)), 4.0)
    assert synthesizer.on_intent(intent("helix", 4.0), now_ns).primitive == "arc"


def test_a_wave_from_rest_goes_on_in_phase():
    points = sine_points(0.4, 3.0, 0.5, 1.0, 1.4, count=401)
    synthesizer, now_ns = flown(wobbling(lambda t: points[round(100 * t)]), 4.0)
    suggestion = synthesizer.on_intent(intent("sine", 4.0), now_ns)
    assert suggestion.params["wavelength"] == pytest.approx(3.0, rel=0.05)
    assert suggestion.params["amplitude"] == pytest.approx(0.4, rel=0.05)
    whole = sine_points(0.4, 3.0, 0.5, 1.0, 3.4, count=1000)
    path = np.array(suggestion.path)[:, :3]
    for point in whole[round(1000 * 1.45 / 3.4) :: 50]:
        assert np.linalg.norm(path - point, axis=1).min() < 0.1


def test_continuation_of_clean_motion_errs_by_five_percent_at_most():
    synthesizer, now_ns = flown(lambda t: along_circle(SPEED * t), 3.0)
    path = np.array(synthesizer.on_intent(intent("arc", 3.0), now_ns).path)[:, :3]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    ahead = np.array([np.interp(3.0 * SPEED, length, path[:, i]) for i in range(3)])
    assert np.linalg.norm(ahead - along_circle(6.0 * SPEED)) < 0.05 * 3.0 * SPEED


@pytest.mark.parametrize(("speed", "expected"), [(0.1, 0.3), (0.6, 0.6), (2.0, 1.0)])
def test_speed_is_the_recent_mean_within_limits(speed, expected):
    synthesizer, now_ns = flown(lambda t: np.array([speed * t, 0.0, 1.0]), 6.0)
    suggestion = synthesizer.on_intent(intent("line", 6.0), now_ns)
    assert suggestion.speed == pytest.approx(expected, abs=0.03)


def test_the_sector_is_that_of_travel_against_the_body():
    synthesizer, now_ns = flown(lambda t: np.array([0.0, SPEED * t, 1.0]), 3.0, yaw=math.pi)
    assert synthesizer.on_intent(intent("line", 3.0), now_ns).heading_sector == 6


def test_the_same_flight_gives_the_same_suggestions_again():
    said = []
    for _ in range(2):
        synthesizer, now_ns = flown(wobbling(lambda t: along_circle(SPEED * t)), 4.0)
        said.append(
            [synthesizer.on_intent(intent(label, 3.0), now_ns) for label in ("arc", "sine")]
        )
    assert said[0] == said[1]


@pytest.mark.parametrize(("world", "known"), [("track", True), ("nowhere", False)])
def test_walls_are_those_of_the_world_that_the_vehicle_is_in(world, known):
    synthesizer, now_ns = flown(lambda t: np.array([SPEED * t, SPEED * t, 1.0]) / 2.0, 3.0)
    status = VehicleStatus(
        stamp=0, seq=0, state="flying", battery=1.0, world=world, plant="tum", collisions=0
    )
    synthesizer.on_vehicle(status)
    said = synthesizer.on_intent(intent("line", 3.0), now_ns)
    assert (synthesizer.world_trouble is None) == known
    text = said.reason if isinstance(said, Refusal) else said.note or ""
    assert ("ahead" in text) == known
    synthesizer.on_vehicle(msgspec.structs.replace(status, world="empty"))
    assert synthesizer.world_trouble is None
    assert len(synthesizer.on_intent(intent("line", 3.0), now_ns).path) == 201


def refusal(synthesizer, message, now_ns):
    answer = synthesizer.on_intent(message, now_ns)
    if message.label == "none":
        assert answer is None
    else:
        assert isinstance(answer, Refusal)
        assert answer.reason == synthesizer.last_refusal
        assert answer.label == message.label
    return synthesizer.last_refusal


def test_every_refusal_has_its_reason():
    line = intent("line", 2.0)
    assert "no pose" in refusal(Synthesizer(Config()), line, S)

    moving, now_ns = flown(lambda t: np.array([SPEED * t, 0.0, 1.0]), 3.0)
    assert "none" in refusal(moving, intent("none"), now_ns)
    assert "spiral" in refusal(moving, unknown_intent(), now_ns)
    assert "old" in refusal(moving, line, now_ns + S // 5)
    moving.on_pose(pose([SPEED * 3.0, 0.0, 1.0], status="lost"), now_ns)
    assert "lost" in refusal(moving, line, now_ns)

    resting, now_ns = flown(lambda t: np.array([0.0, 0.0, 1.0]), 3.0)
    assert "moved only 0.0 m" in refusal(resting, line, now_ns)

    curving, now_ns = flown(lambda t: along_circle(SPEED * t), 2.0)
    assert "degrees" in refusal(curving, intent("arc", 1.2), now_ns)

    wild, now_ns = flown(lambda t: np.array([t, math.sin(9.0 * t), 1.0 + math.cos(7.0 * t)]), 4.0)
    for label in ("line", "arc", "helix"):
        assert label in refusal(wild, intent(label, 4.0), now_ns)


def unknown_intent():
    probabilities = {"line": 0.1, "arc": 0.1, "sine": 0.1, "helix": 0.1, "spiral": 0.6}
    return msgspec.structs.replace(intent("none"), label="spiral", probabilities=probabilities)


def test_a_good_suggestion_clears_the_refusal():
    synthesizer, now_ns = flown(lambda t: np.array([SPEED * t, 0.0, 1.0]), 3.0)
    synthesizer.on_intent(intent("none"), now_ns)
    assert synthesizer.last_refusal
    assert synthesizer.on_intent(intent("line"), now_ns)
    assert synthesizer.last_refusal is None


@settings(max_examples=60, deadline=None)
@given(
    label=st.sampled_from(["line", "arc", "sine", "helix"]),
    seed=st.integers(0, 10_000),
    window_s=st.floats(0.0, 6.0),
    roughness=st.floats(0.0, 1.0),
)
def test_any_motion_gives_a_path_from_the_vehicle_or_a_reason(label, seed, window_s, roughness):
    rng = np.random.default_rng(seed)
    waves = rng.normal(0.0, 1.0, (3, 4)) * np.array([1.0, 1.0, 0.3, 0.1])

    def where(t):
        powers = np.array([t, 0.3 * t * t, 1.0, 0.0])
        return waves @ powers + roughness * 0.3 * np.sin(3.0 * t + waves[:, 0])

    synthesizer, now_ns = flown(where, 4.0)
    suggestion = synthesizer.on_intent(intent(label, window_s), now_ns)
    if isinstance(suggestion, Refusal):
        assert suggestion.reason
        return
    assert isinstance(suggestion, Suggestion)
    path = np.array(suggestion.path)
    assert path[0, :3] == pytest.approx(where(4.0))
    assert np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1).max() < 0.25
    assert not suggestion.closed or suggestion.primitive == "arc"
    assert 0.3 <= suggestion.speed <= 1.0
    assert path[:, 2].min() >= 0.29 or path[:, 2].min() >= path[0, 2] - 0.01
    assert set(suggestion.params_std) <= set(suggestion.params)


def ask(primitive, points, speed=None):
    request = FitRequest(
        primitive=primitive, points=[tuple(map(float, p)) for p in points], speed=speed
    )
    return Synthesizer(Config()).fit(request, 123, S)


def test_a_fit_continues_from_the_last_point():
    points = arc_points(0.0, 0.0, 1.0, 2.0, 0.0, -2.0)
    suggestion = ask("arc", points, speed=0.7)
    assert suggestion.params["radius"] == pytest.approx(2.0)
    assert suggestion.params["sweep"] < 0.0
    assert suggestion.path[0][:3] == pytest.approx(points[-1])
    assert suggestion.speed == 0.7
    assert suggestion.stamp == 123


def test_a_fit_of_very_many_points_is_as_good():
    rng = np.random.default_rng(0)
    points = noisy(arc_points(0.0, 0.0, 1.0, 2.0, 0.0, 2.0, count=50_000), 0.02, rng)
    assert ask("arc", points).params["radius"] == pytest.approx(2.0, rel=0.01)


def test_the_path_of_a_huge_shape_still_fits_a_suggestion():
    assert len(ask("sine", sine_points(100.0, 1000.0, 0.3, 0.0, 1.5)).path) <= 4096


@pytest.mark.parametrize(
    ("primitive", "points", "field"),
    [
        ("loop", np.zeros((10, 3)), "primitive"),
        ("line", np.zeros((10, 3)), "points"),
        ("arc", np.eye(3)[:2], "points"),
        ("arc", np.outer(np.arange(90.0), [1.0, 0.0, 0.0]), "points"),
        ("sine", np.outer(np.arange(90.0), [1.0, 0.0, 0.0]), "points"),
        ("helix", np.ones((90, 3)), "points"),
        ("line", np.full((10, 3), 1e300), "points"),
    ],
)
def test_a_bad_fit_is_refused_with_its_field(primitive, points, field):
    with pytest.raises(RefusalError) as caught:
        ask(primitive, points)
    assert caught.value.field == field


@pytest.mark.parametrize(
    "fields",
    [
        {"min_speed_mps": 0.0},
        {"max_speed_mps": 0.1},
        {"cruise_mps": 3.0},
        {"min_extent_m": -1.0},
        {"min_radius_m": 20.0},
        {"max_doubt": 0.0},
        {"fence_radius_m": 0.0},
        {"min_height_m": 20.0},
        {"half_width_m": -0.1},
        {"margin_m": -0.1},
        {"max_position_std_m": -1.0},
    ],
)
def test_a_configuration_that_makes_no_sense_is_refused(fields):
    with pytest.raises(ValueError, match=next(iter(fields))):
        Config(**fields)
