"""Which axis of a pad is which."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.operator.profiles import PROFILES, Profile, profile_of, read, shaped

UP_LEFT = {"ps3": (0, 1, 3, 4), "xbox": (0, 1, 3, 4), "generic": (0, 1, 2, 3)}
"""Left x, left y, right x, right y of SDL; x grows to the right, y downward."""


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        ("Sony PLAYSTATION(R)3 Controller", "ps3"),
        ("PS3 Controller", "ps3"),
        ("Microsoft X-Box 360 pad", "xbox"),
        ("Xbox Series X Controller", "xbox"),
        ("Logitech Dual Action", "generic"),
        ("", "generic"),
    ],
)
def test_a_profile_is_chosen_by_the_pads_name(name: str, profile: str) -> None:
    assert profile_of(name) is PROFILES[profile]


@pytest.mark.parametrize("name", PROFILES)
def test_forward_left_up_and_counter_clockwise_are_positive(name: str) -> None:
    left_x, left_y, right_x, right_y = UP_LEFT[name]
    profile = PROFILES[name]

    def only(index: int) -> tuple[float, float, float, float]:
        reading = read(profile, lambda i: -1.0 if i == index else 0.0, lambda _: False, 0.1)
        sticks = reading.sticks
        return sticks.vx, sticks.vy, sticks.vz, sticks.wz

    assert only(left_y) == (1.0, 0.0, 0.0, 0.0)
    assert only(left_x) == (0.0, 1.0, 0.0, 0.0)
    assert only(right_y) == (0.0, 0.0, 1.0, 0.0)
    assert only(right_x) == (0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("profile", PROFILES.values())
def test_no_single_button_stops_the_motors(profile: Profile) -> None:
    for pressed in range(20):
        reading = read(profile, lambda _: 0.0, lambda i, p=pressed: i == p, 0.1)
        assert "emergency" not in reading.decisions
        assert len(reading.decisions) + len(reading.buttons) <= 1


@pytest.mark.parametrize("profile", PROFILES.values())
def test_every_decision_and_four_face_buttons_are_on_every_pad(profile: Profile) -> None:
    reading = read(profile, lambda _: 0.0, lambda _: True, 0.1)
    assert reading.decisions == {"accept", "cancel", "takeoff", "land", "emergency"}
    assert len(set(reading.buttons)) == 4


@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.49))
def test_the_dead_band_is_cut_out_without_a_jump(axis: float, dead_band: float) -> None:
    value = shaped(axis, dead_band)
    assert -1.0 <= value <= 1.0
    assert value * axis >= 0.0
    if abs(axis) <= dead_band:
        assert value == 0.0
    assert shaped(1.0, dead_band) == 1.0
    assert shaped(-axis, dead_band) == -value
