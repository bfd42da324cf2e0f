"""The table of topics and queries is whole and coherent."""

import re

import pytest

from common import messages as m
from common.topics import (
    QUERIES,
    SERVICES,
    TOPICS,
    Delivery,
    Topic,
    alive_key_of,
    key_of,
)

by_topic = pytest.mark.parametrize("topic", TOPICS.values(), ids=lambda row: row.name)


@by_topic
def test_a_topics_name_is_a_key(topic: Topic) -> None:
    assert re.fullmatch(r"[a-z]+(/[a-z]+)?", topic.name)
    assert TOPICS[topic.name] is topic


@by_topic
def test_publishers_and_subscribers_are_services(topic: Topic) -> None:
    assert topic.publisher in SERVICES
    assert set(topic.subscribers) <= set(SERVICES)
    assert len(set(topic.subscribers)) == len(topic.subscribers)


@by_topic
def test_a_message_outlives_the_gap_to_the_next(topic: Topic) -> None:
    assert topic.max_age_s > 0
    if topic.rate_hz is not None:
        assert topic.rate_hz > 0
        assert topic.max_age_s > 1.5 / topic.rate_hz


@by_topic
def test_only_pictures_are_video(topic: Topic) -> None:
    assert topic.is_video == (topic.message is m.Image)
    if topic.is_video:
        assert topic.delivery is Delivery.STREAM


def test_commands_are_worthless_after_a_fifth_of_a_second() -> None:
    commands = [row for row in TOPICS.values() if row.delivery is Delivery.COMMAND]
    assert {row.name for row in commands} == {"stick", "console/stick", "command"}
    assert all(row.max_age_s == 0.2 for row in commands)


def test_no_flight_service_reads_the_truth() -> None:
    assert set(TOPICS["truth"].subscribers) <= {"operator"}


def test_every_service_reports_its_health() -> None:
    assert {name for name in TOPICS if name.startswith("health/")} == {
        f"health/{service}" for service in SERVICES
    }


def test_every_query_has_a_server_and_no_topics_name() -> None:
    for name, query in QUERIES.items():
        assert query.name == name
        assert query.server in SERVICES
        assert name.startswith(f"{query.server}/")
        assert name not in TOPICS


def test_keys_hold_the_vehicle_and_the_name() -> None:
    assert key_of("drone0", "camera/front") == "autocomplete/drone0/camera/front"
    assert alive_key_of("a-b_9", "sim") == "autocomplete/a-b_9/alive/sim"


@pytest.mark.parametrize("vehicle", ["", "Drone", "a/b", "*", "a" * 33, "drone 0", "drone0\n"])
def test_a_vehicle_that_cannot_be_a_chunk_of_a_key_is_refused(vehicle: str) -> None:
    with pytest.raises(ValueError, match="vehicle"):
        key_of(vehicle, "pose")
