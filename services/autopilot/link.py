"""Whether the operator's sticks count."""

from common.clock import nanoseconds, seconds
from common.messages import Stick
from common.sticks import is_neutral


class StickLink:
    """The newest stick, its age by the receiver's clock, and whether it counts.

    After a loss, or after they were stuck, the sticks must pass through neutral before they count.
    At the start they count at once: nothing was lost, and after a restart in the air the operator
    keeps what they hold.

    Args:
        loss_s: a link is lost when its newest stick is older.
        dead_band: deflections up to this are neutral.
        stuck_s: deflected sticks that have not changed at all for so long are stuck.
    """

    def __init__(self, loss_s: float, dead_band: float, stuck_s: float) -> None:
        self._loss_ns = nanoseconds(loss_s)
        self._stuck_ns = nanoseconds(stuck_s)
        self._dead_band = dead_band
        self._armed = True
        self._moved_ns = 0
        self._armed_ns = 0
        self.newest: Stick | None = None
        self.arrival_ns: int | None = None
        self.counted_ns: int | None = None
        """When the newest stick that counts arrived."""

    def receive(self, stick: Stick, now_ns: int) -> bool:
        """Take a stick in; False if it is older than the newest of the same unbroken link."""
        live = self.is_live(now_ns)
        if live and self.newest is not None and stick.seq < self.newest.seq:
            return False
        if self.newest is None:
            self._armed_ns = now_ns
        elif not live:
            self._armed = False
        neutral = is_neutral(stick, self._dead_band)
        if not live or neutral or self.newest is None or _axes(stick) != _axes(self.newest):
            self._moved_ns = now_ns
        if neutral and not self._armed:
            self._armed, self._armed_ns = True, now_ns
        self.newest, self.arrival_ns = stick, now_ns
        if self.is_stuck(now_ns):
            self._armed = False
        if self._armed:
            self.counted_ns = now_ns
        return True

    def is_live(self, now_ns: int) -> bool:
        """Whether a stick arrived within the allowed age."""
        return self.arrival_ns is not None and now_ns - self.arrival_ns <= self._loss_ns

    def is_deflected(self, now_ns: int) -> bool:
        """Whether a live stick is beyond the dead band, counted or not."""
        return (
            self.newest is not None
            and self.is_live(now_ns)
            and not is_neutral(self.newest, self._dead_band)
        )

    def still_s(self, now_ns: int) -> float:
        """How long deflected sticks have not moved at all; 0 for resting ones."""
        return seconds(now_ns - self._moved_ns) if self.is_deflected(now_ns) else 0.0

    def is_stuck(self, now_ns: int) -> bool:
        """Whether the sticks are held as no hand holds them."""
        return self.is_deflected(now_ns) and now_ns - self._moved_ns > self._stuck_ns

    def commands(self, now_ns: int) -> bool:
        """Whether the operator flies: a live stick that counts is beyond the dead band."""
        return self._armed and self.is_deflected(now_ns) and not self.is_stuck(now_ns)

    def steady_since_ns(self, now_ns: int) -> int | None:
        """Since when the sticks arrive and count without a break; None if they do not."""
        return self._armed_ns if self._armed and self.is_live(now_ns) else None


def _axes(stick: Stick) -> tuple[float, float, float, float]:
    return stick.vx, stick.vy, stick.vz, stick.wz
