import type { Source } from "./hands";
import { NEUTRAL, type Action, type Sticks } from "./protocol";

// The "standard" mapping of the Gamepad API; left stick moves, right stick climbs and turns.
const BUTTONS: Record<number, Action> = { 0: "accept", 1: "cancel", 8: "land", 9: "takeoff" };

/** The first pad that the browser knows. */
export class Pad implements Source {
  private pressed = new Set<number>();

  constructor(private readonly act: (action: Action) => void) {}

  read(): Sticks {
    const pad = navigator.getGamepads().find((each) => each?.connected);
    if (!pad) return NEUTRAL;
    const pressed = new Set<number>();
    pad.buttons.forEach((button, index) => button.pressed && pressed.add(index));
    for (const index of pressed) {
      const action = BUTTONS[index];
      if (action !== undefined && !this.pressed.has(index)) this.act(action);
    }
    this.pressed = pressed;
    const axis = (index: number) => -(pad.axes[index] ?? 0);
    return { vx: axis(1), vy: axis(0), vz: axis(3), wz: axis(2) };
  }
}
