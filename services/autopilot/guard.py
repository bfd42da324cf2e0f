"""The last look at every command: finite, within full stick, in order."""

import math
from dataclasses import astuple

from common.messages import Command, CommandAction, FlightMode
from services.autopilot.follower import Sticks


class Guard:
    """Makes the commands that go out, and counts those it had to repair."""

    def __init__(self) -> None:
        self.repaired = 0
        self._stamp_ns: int | None = None

    def command(
        self, sticks: Sticks, action: CommandAction, mode: FlightMode, stamp_ns: int
    ) -> Command:
        """The command that may go out.

        One axis that is not finite makes all neutral: half a command is no command. A clock that
        is set back does not make commands look older than those before.
        """
        wanted = astuple(sticks)
        axes = wanted if all(map(math.isfinite, wanted)) else (0.0,) * len(wanted)
        vx, vy, vz, wz = (max(-1.0, min(1.0, axis)) for axis in axes)
        stamp = stamp_ns if self._stamp_ns is None else max(stamp_ns, self._stamp_ns)
        if (vx, vy, vz, wz) != wanted or stamp != stamp_ns:
            self.repaired += 1
        self._stamp_ns = stamp
        return Command(stamp=stamp, seq=0, vx=vx, vy=vy, vz=vz, wz=wz, action=action, mode=mode)
