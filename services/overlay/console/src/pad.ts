import type { Source } from "./hands";
import { NEUTRAL, type Action, type Sticks } from "./protocol";

// The "standard" mapping of the Gamepad API; left stick moves, right stick climbs and turns, the
// shoulders decide: as the operator service has it for a pad that is plugged in there.
const BUTTONS: Record<number, Action> = { 4: "cancel", 5: "accept", 8: "land", 9: "takeoff" };
/** The face buttons end a primitive while data is collected. */
const FACES = [0, 1, 2, 3];
const REST = 0.1;

/** The first pad that the browser knows. */
export class Pad implements Source {
  private pressed = new Set<number>();

  constructor(
    private readonly act: (action: Action) => void,
    private readonly mark: () => void,
  ) {}

  read(): Sticks {
    const pad = navigator.getGamepads().find((each) => each?.connected);
    if (!pad) return NEUTRAL;
    const pressed = new Set<number>();
    pad.buttons.forEach((button, index) => button.pressed && pressed.add(index));
    for (const index of pressed) {
      if (this.pressed.has(index)) continue;
      const action = BUTTONS[index];
      if (action !== undefined) this.act(action);
      else if (FACES.includes(index)) this.mark();
    }
    this.pressed = pressed;
    const axis = (index: number) => {
      const value = -(pad.axes[index] ?? 0);
      return Math.abs(value) <= REST ? 0 : value;
    };
    return { vx: axis(1), vy: axis(0), vz: axis(3), wz: axis(2) };
  }
}
