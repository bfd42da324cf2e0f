"""One pair of hands at a time; neutral once after them; never old values."""

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from services.overlay.lease import HOLD_NS, MARK_NS, NEUTRAL, STICK_MAX_AGE_NS, PadLease

MS = 1_000_000
FORWARD = (0.8, 0.0, 0.0, 0.0)
LEFT = (0.0, 0.8, 0.0, 0.0)


def lease_of(*clients: int) -> PadLease:
    """Every client has said once that it holds nothing."""
    lease = PadLease()
    for client in clients:
        lease.release(client, 0)
    return lease


def test_sticks_are_sent_while_they_are_held_and_neutral_once_after():
    lease = lease_of(1)
    assert lease.due(0) is None
    assert lease.move(1, FORWARD, 0)
    assert lease.due(10 * MS) == FORWARD
    assert lease.due(30 * MS) == FORWARD
    lease.release(1, 40 * MS)
    assert lease.due(50 * MS) == NEUTRAL
    assert lease.due(70 * MS) is None


def test_a_second_page_is_busy_until_the_first_has_let_go_for_a_while():
    lease = lease_of(1, 2)
    lease.move(1, FORWARD, 0)
    assert not lease.move(2, LEFT, 10 * MS)
    assert lease.due(20 * MS) == FORWARD
    assert (lease.standing(1, 20 * MS), lease.standing(2, 20 * MS)) == ("yours", "busy")
    lease.release(1, 30 * MS)
    assert not lease.move(2, LEFT, 40 * MS)
    assert lease.standing(2, 31 * MS + HOLD_NS) == "free"
    assert lease.move(2, LEFT, 31 * MS + HOLD_NS)
    assert lease.due(32 * MS + HOLD_NS) == LEFT


def test_sticks_that_stop_coming_are_neutral_once_and_must_be_released_before_they_count():
    lease = lease_of(1)
    lease.move(1, FORWARD, 0)
    late_ns = STICK_MAX_AGE_NS + MS
    assert lease.due(late_ns) == NEUTRAL
    assert lease.due(late_ns + MS) is None
    assert not lease.move(1, FORWARD, late_ns + 2 * MS)
    assert lease.due(late_ns + 3 * MS) is None
    assert lease.standing(1, late_ns + 3 * MS) == "stale"
    lease.release(1, late_ns + 4 * MS)
    assert lease.move(1, FORWARD, late_ns + 5 * MS)
    assert lease.due(late_ns + 6 * MS) == FORWARD


def test_a_page_that_comes_with_sticks_held_does_nothing_until_it_lets_go():
    lease = PadLease()
    assert not lease.move(1, FORWARD, 0)
    assert lease.due(MS) is None
    lease.release(1, 2 * MS)
    assert lease.move(1, FORWARD, 3 * MS)


def test_a_page_that_leaves_is_neutral_once_and_frees_the_pad():
    lease = lease_of(1, 2)
    lease.move(1, FORWARD, 0)
    lease.leave(1, MS)
    assert lease.due(2 * MS) == NEUTRAL
    assert lease.due(3 * MS) is None
    assert lease.move(2, LEFT, 2 * MS + HOLD_NS)


def test_a_release_by_another_page_does_not_let_go():
    lease = lease_of(1, 2)
    lease.move(1, FORWARD, 0)
    lease.release(2, MS)
    assert lease.due(2 * MS) == FORWARD


axis = st.floats(0.1, 1.0)


class Pages(RuleBasedStateMachine):
    """Three pages that push, let go, freeze, leave and come, against a clock."""

    def __init__(self) -> None:
        super().__init__()
        self.lease = PadLease()
        self.now_ns = 0
        self.accepted_ns = -(10**12)
        self.sticks = NEUTRAL
        self.mover: int | None = None
        self.neutral_owed = False
        self.centred: set[int] = set()

    @rule(client=st.integers(1, 3), sticks=st.tuples(axis, axis, axis, axis))
    def push(self, client: int, sticks: tuple[float, float, float, float]) -> None:
        taken = self.lease.move(client, sticks, self.now_ns)
        if not taken:
            return
        assert client in self.centred
        if self.mover not in (None, client):
            assert self.now_ns - self.accepted_ns > HOLD_NS
        self.mover, self.sticks, self.accepted_ns = client, sticks, self.now_ns
        self.neutral_owed = True

    @rule(client=st.integers(1, 3))
    def let_go(self, client: int) -> None:
        self.lease.release(client, self.now_ns)
        self.centred.add(client)
        if client == self.mover:
            self.sticks = NEUTRAL

    @rule(client=st.integers(1, 3))
    def leave(self, client: int) -> None:
        self.lease.leave(client, self.now_ns)
        self.centred.discard(client)
        if client == self.mover:
            self.sticks = NEUTRAL

    @rule(ms=st.sampled_from([1, 20, 50, 150, 201, 900, 1100]))
    def wait(self, ms: int) -> None:
        self.now_ns += ms * MS

    @rule()
    def send(self) -> None:
        sent = self.lease.due(self.now_ns)
        held = self.now_ns - self.accepted_ns <= STICK_MAX_AGE_NS and self.sticks != NEUTRAL
        if held:
            assert sent == self.sticks
        else:
            assert sent == (NEUTRAL if self.neutral_owed else None)
            self.neutral_owed = False

    @invariant()
    def at_most_one_page_flies(self) -> None:
        standings = [self.lease.standing(client, self.now_ns) for client in (1, 2, 3)]
        assert standings.count("yours") <= 1


TestPages = Pages.TestCase


def test_a_mark_is_held_for_a_moment_with_the_sticks_as_they_are():
    lease = lease_of(1)
    lease.move(1, FORWARD, 0)
    lease.mark(1, 0)
    assert (lease.due(20 * MS), lease.is_marked(20 * MS)) == (FORWARD, True)
    lease.release(1, 30 * MS)
    assert (lease.due(40 * MS), lease.is_marked(40 * MS)) == (NEUTRAL, True)
    assert (lease.due(MARK_NS), lease.is_marked(MARK_NS)) == (NEUTRAL, False)
    assert lease.due(MARK_NS + 20 * MS) is None


def test_a_mark_of_a_page_that_does_not_fly_is_none():
    lease = lease_of(1, 2)
    lease.move(1, FORWARD, 0)
    lease.mark(2, 10 * MS)
    assert not lease.is_marked(20 * MS)
