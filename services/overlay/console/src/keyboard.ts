import type { Source } from "./hands";
import type { Action, Sticks } from "./protocol";

const DEFLECTION = 0.8;
const RAMP_PER_S = 4;

const MOVES: Record<string, [keyof Sticks, number]> = {
  KeyW: ["vx", 1],
  KeyS: ["vx", -1],
  KeyA: ["vy", 1],
  KeyD: ["vy", -1],
  ArrowUp: ["vz", 1],
  ArrowDown: ["vz", -1],
  ArrowLeft: ["wz", 1],
  ArrowRight: ["wz", -1],
};

const ACTIONS: Record<string, Action> = {
  Enter: "accept",
  Escape: "cancel",
  KeyT: "takeoff",
  KeyL: "land",
};

/** Keys as sticks: a key ramps its axis up instead of jumping, so that curves can be flown. */
export class Keyboard implements Source {
  private readonly down = new Set<string>();
  private readonly sticks: Sticks = { vx: 0, vy: 0, vz: 0, wz: 0 };
  private last_ms = performance.now();

  constructor(act: (action: Action) => void, mark: () => void) {
    addEventListener("keydown", (event) => {
      // Ctrl+L and its like belong to the browser.
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const action = ACTIONS[event.code];
      if (event.code in MOVES) this.down.add(event.code);
      else if (action !== undefined && !event.repeat) act(action);
      else if (event.code === "KeyE" && !event.repeat) mark();
      else return;
      event.preventDefault();
    });
    addEventListener("keyup", (event) => this.down.delete(event.code));
    addEventListener("blur", () => this.down.clear());
  }

  read(): Sticks {
    const now_ms = performance.now();
    const step = (RAMP_PER_S * Math.min(now_ms - this.last_ms, 100)) / 1000;
    this.last_ms = now_ms;
    const goal: Sticks = { vx: 0, vy: 0, vz: 0, wz: 0 };
    for (const code of this.down) {
      const move = MOVES[code];
      if (move !== undefined) goal[move[0]] += move[1] * DEFLECTION;
    }
    for (const axis of ["vx", "vy", "vz", "wz"] as const) {
      const gap = goal[axis] - this.sticks[axis];
      // Letting go is immediate: only pushing is ramped.
      this.sticks[axis] =
        goal[axis] === 0 ? 0 : this.sticks[axis] + Math.sign(gap) * Math.min(Math.abs(gap), step);
    }
    return { ...this.sticks };
  }
}
