"""What a page may say."""

import json

import msgspec
import pytest

from services.overlay import protocol


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{"type":"shown"}', protocol.Shown()),
        ('{"type":"release"}', protocol.Released()),
        (
            '{"type":"stick","vx":1,"vy":-0.5,"vz":0,"wz":0}',
            protocol.StickMoved(1.0, -0.5, 0.0, 0.0),
        ),
        (
            '{"type":"decide","action":"accept","nonce":7,"suggestion":3}',
            protocol.Decided("accept", 7, 3),
        ),
        ('{"type":"decide","action":"land","nonce":8}', protocol.Decided("land", 8)),
    ],
)
def test_a_page_may_say(text, expected):
    assert protocol.decode(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hello",
        "[]",
        "{}",
        '{"type":"fly"}',
        '{"type":"stick","vx":1}',
        '{"type":"stick","vx":1.5,"vy":0,"vz":0,"wz":0}',
        '{"type":"stick","vx":NaN,"vy":0,"vz":0,"wz":0}',
        '{"type":"stick","vx":1e999,"vy":0,"vz":0,"wz":0}',
        '{"type":"stick","vx":"1","vy":0,"vz":0,"wz":0}',
        '{"type":"stick","vx":0,"vy":0,"vz":0,"wz":0,"more":1}',
        '{"type":"decide","action":"dance","nonce":1}',
        '{"type":"decide","action":"accept"}',
        '{"type":"decide","action":"accept","nonce":1,"suggestion":-1}',
    ],
)
def test_a_page_may_not_say(text):
    with pytest.raises(msgspec.MsgspecError):
        protocol.decode(text)


def test_answers_are_json_maps_with_a_type():
    answer = json.loads(protocol.encode(protocol.Answer(7, True, "accepted")))
    assert answer == {"type": "decision", "nonce": 7, "ok": True, "reason": "accepted"}
    assert json.loads(protocol.encode(protocol.Problem("no"))) == {"type": "error", "error": "no"}
