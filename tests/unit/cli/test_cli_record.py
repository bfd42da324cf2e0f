"""What `autocomplete record` cannot keep up with is counted, not silently left out."""

from cli.record import BEHIND, _Arrival, _Inbox


def test_what_finds_no_room_is_counted() -> None:
    inbox = _Inbox()
    for number in range(BEHIND + 3):
        inbox.put(_Arrival("stick", b"", number))
    assert (inbox.waiting.qsize(), inbox.lost) == (BEHIND, 3)
    assert inbox.waiting.get_nowait().utc_ns == 0
