"""`reset` starts anew in place, or says what is allowed and changes nothing."""

import pytest
from flights import fly, hovering
from msgspec.structs import replace

from common.messages import ResetRequest, encode
from services.sim.body import Sticks
from services.sim.config import Config
from services.sim.core import ResetError, Simulation


def test_another_world_brings_its_own_start() -> None:
    simulation = hovering()
    status = simulation.reset(ResetRequest(world="track"))
    assert (status.world, status.state, status.collisions) == ("track", "landed", 0)
    assert simulation.state.position_m == pytest.approx((0.0, 0.0, 0.055))


def test_what_is_left_out_stays_as_it_was_set() -> None:
    simulation = hovering()
    simulation.reset(ResetRequest(position=(2.0, 1.0, 1.5), yaw=0.5))
    fly(simulation, 1.0, Sticks(vx=1.0))
    status = simulation.reset(ResetRequest())
    assert status.state == "flying"
    assert simulation.state.position_m == pytest.approx((2.0, 1.0, 1.5))
    assert simulation.state.yaw_rad == pytest.approx(0.5)


def test_a_seed_is_the_same_flight_again_whenever_it_begins() -> None:
    config = Config(world="track", plant="ardrone", wind_mps=4.0, renderer="none")
    simulation = Simulation(config)

    def flight(seed: int) -> list[tuple[str, bytes]]:
        simulation.reset(ResetRequest(position=(1.0, 0.0, 1.0), seed=seed))
        begin_ns = simulation.now_ns
        _, messages = fly(simulation, 1.0, Sticks(vx=0.3, wz=0.2))
        return [
            (topic, encode(replace(message, stamp=message.stamp - begin_ns)))
            for topic, message in messages
        ]

    first = flight(5)
    fly(simulation, 0.137)
    assert flight(5) == first
    assert flight(6) != first
    simulation.close()


@pytest.mark.parametrize(
    ("request_", "field", "allowed"),
    [
        (ResetRequest(world="nowhere"), "world", "track"),
        (ResetRequest(plant="zeppelin"), "plant", "ardrone"),
        (ResetRequest(position=(0.0, 0.0, -1.0)), "position", "0..100 m"),
        (ResetRequest(position=(1e6, 0.0, 1.0)), "position", "1000 m"),
        (ResetRequest(position=(4.5, 4.2, 0.5)), "position", "free"),
    ],
)
def test_a_bad_request_is_refused_and_the_flight_goes_on(
    request_: ResetRequest, field: str, allowed: str
) -> None:
    simulation = hovering(world="track")
    fly(simulation, 0.5, Sticks(vx=0.5))
    before = simulation.state
    with pytest.raises(ResetError, match=allowed) as caught:
        simulation.reset(request_)
    assert caught.value.field == field
    assert simulation.state == before
    assert simulation.status().state == "flying"
    fly(simulation, 0.5, Sticks(vx=0.5))
    assert simulation.state.velocity_mps[0] == pytest.approx(0.5, abs=0.05)


def test_a_long_name_is_not_said_back_in_full() -> None:
    simulation = Simulation(Config(world="empty", renderer="none"))
    for request in (ResetRequest(world="x" * 100_000), ResetRequest(plant="x" * 100_000)):
        with pytest.raises(ResetError, match=r"no (world|plant) 'x+\.\.\.x+'; there are") as caught:
            simulation.reset(request)
        assert len(str(caught.value)) < 200
    simulation.close()


@pytest.mark.parametrize(
    "settings",
    [
        {"plant": "zeppelin"},
        {"world": "nowhere"},
        {"seed": -1},
        {"sensor_noise": -0.1},
        {"front_fps": 0.0},
        {"exposure_s": 1.0},
        {"wind_mps": 50.0},
        {"battery": 0.0},
        {"command_delay_s": 2.0},
        {"jpeg_quality": 0},
    ],
)
def test_a_bad_configuration_is_refused_with_its_field(settings: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(settings))):
        Config(**settings)


def test_it_starts_where_the_world_says() -> None:
    assert Simulation(Config()).state.position_m == pytest.approx((0.0, 0.0, 0.055))
