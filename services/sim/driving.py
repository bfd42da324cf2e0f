"""The states of a vehicle that drives: it stands on the ground, so it never takes off or lands.

It is `flying` while it follows the sticks. In an emergency it brakes; once it stands still it may
be told `land`, and is `landed`: parked. `takeoff` lets it drive again. What bars its way is a
collision, and so is a hard fall; what it stands on is none. Tipped over it stays in `emergency`.
"""

from common.messages import CommandAction
from services.sim.body import BodyState, Loads
from services.sim.hull import Touch
from services.sim.vehicle import CAPSIZED_COS, Vehicle, lies_still


class Driven(Vehicle):
    """Turns commands into loads, step by step: of what drives."""

    def _obey(self, action: CommandAction, state: BodyState, touch: Touch) -> None:
        if action == "emergency":
            self.state = "emergency"
        elif action == "takeoff":
            if self.state == "landed":
                self.state = "flying"
        elif self.state == "emergency" and lies_still(state, touch):
            self.state = "landed"

    def _move_on(self, state: BodyState, touch: Touch, below_m: float) -> None:
        if state.rotation[8] < CAPSIZED_COS or self.battery == 0.0:
            self.state = "emergency"

    def _is_hit(self, touch: Touch) -> bool:
        return touch.side or self._has_fallen

    def _spend(self, loads: Loads) -> None:
        self.battery = max(0.0, self.battery - self._drain)
