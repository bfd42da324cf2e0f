"""Whether the operator's sticks count."""

from common.clock import nanoseconds
from common.messages import Stick
from common.sticks import is_neutral


class StickLink:
    """The newest stick, its age by the receiver's clock, and whether it counts.

    After a loss the sticks must pass through neutral before they count. At the start they count at
    once: nothing was lost, and after a restart in the air the operator keeps what they hold.
    """

    def __init__(self, loss_s: float, dead_band: float) -> None:
        self._loss_ns = nanoseconds(loss_s)
        self._dead_band = dead_band
        self._armed = True
        self.newest: Stick | None = None
        self.arrival_ns: int | None = None
        self.counted_ns: int | None = None
        """When the newest stick that counts arrived."""

    def receive(self, stick: Stick, now_ns: int) -> bool:
        """Take a stick in; False if it is older than the newest of the same unbroken link."""
        live = self.is_live(now_ns)
        if live and self.newest is not None and stick.seq < self.newest.seq:
            return False
        if not live and self.newest is not None:
            self._armed = False
        if is_neutral(stick, self._dead_band):
            self._armed = True
        self.newest, self.arrival_ns = stick, now_ns
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

    def commands(self, now_ns: int) -> bool:
        """Whether the operator flies: a live stick that counts is beyond the dead band."""
        return self._armed and self.is_deflected(now_ns)
