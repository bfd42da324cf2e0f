"""What a person notices of what is shown."""

from services.operator.attention import Attention

MS = 1_000_000


def test_what_is_shown_is_noticed_after_the_delay_once_and_in_order() -> None:
    attention = Attention[str](0.25)
    attention.show("first", 0)
    attention.show("second", 100 * MS)
    assert attention.notice(249 * MS) == []
    assert attention.newest is None
    assert attention.notice(250 * MS) == [(0, "first")]
    assert attention.newest == (0, "first")
    attention.show("third", 110 * MS)
    assert attention.notice(1000 * MS) == [(100 * MS, "second"), (110 * MS, "third")]
    assert attention.newest == (110 * MS, "third")
    assert attention.notice(1000 * MS) == []
