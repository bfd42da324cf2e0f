"""The last look at every command: finite, within full stick, in order, from a live sender."""

import math

from common.clock import seconds
from common.messages import Command, CommandAction, FlightMode
from services.autopilot.control import Sticks

LONGEST_S = 0.1
"""After a longer pause the sticks may have moved no farther than in this time."""


class Guard:
    """Makes the commands that go out, and counts those it had to repair.

    Args:
        slew_ps: how fast the autopilot's own sticks may move, fractions of full stick a second. The
            human's are not slowed: a take-over shows whole in the very next command. Nor is a
            return to neutral.
    """

    def __init__(self, slew_ps: float) -> None:
        self.repaired = 0
        self._slew_ps = slew_ps
        self._stamp_ns: int | None = None
        self._now_ns: int | None = None
        self._axes: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def command(
        self,
        sticks: Sticks,
        action: CommandAction,
        mode: FlightMode,
        stamp_ns: int,
        *,
        now_ns: int,
        live: bool,
    ) -> Command:
        """The command that may go out.

        One axis that is not finite makes all neutral: half a command is no command. A clock that
        is set back does not make commands look older than those before.

        Args:
            sticks: what is wanted.
            action: what the vehicle is told.
            mode: who flies.
            stamp_ns: of the command.
            now_ns: monotonic time.
            live: whether sticks still arrive; without them nothing moves.
        """
        wanted = (sticks.vx, sticks.vy, sticks.vz, sticks.wz)
        finite = all(map(math.isfinite, wanted))
        allowed = wanted if finite and (live or not any(wanted)) else (0.0,) * len(wanted)
        axes: tuple[float, ...] = tuple(max(-1.0, min(1.0, axis)) for axis in allowed)
        stamp = stamp_ns if self._stamp_ns is None else max(stamp_ns, self._stamp_ns)
        if axes != wanted or stamp != stamp_ns:
            self.repaired += 1
        if mode != "manual" and any(axes):
            axes = self._slewed(axes, now_ns)
        self._stamp_ns, self._now_ns, self._axes = stamp, now_ns, axes
        vx, vy, vz, wz = axes
        return Command(stamp=stamp, seq=0, vx=vx, vy=vy, vz=vz, wz=wz, action=action, mode=mode)

    def _slewed(self, axes: tuple[float, ...], now_ns: int) -> tuple[float, ...]:
        pause_s = LONGEST_S if self._now_ns is None else seconds(now_ns - self._now_ns)
        most = self._slew_ps * min(max(pause_s, 0.0), LONGEST_S)
        return tuple(
            last + max(-most, min(most, axis - last))
            for axis, last in zip(axes, self._axes, strict=True)
        )
