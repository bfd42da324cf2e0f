import { NEUTRAL, type Sticks, type ToServer } from "./protocol";

const PERIOD_MS = 20;
const DEAD_BAND = 0.05;

/** Where sticks come from: a pad, the keyboard, thumbs on the screen. */
export interface Source {
  read(): Sticks;
}

function isNeutral(sticks: Sticks): boolean {
  const { vx, vy, vz, wz } = sticks;
  return Math.max(Math.abs(vx), Math.abs(vy), Math.abs(vz), Math.abs(wz)) <= DEAD_BAND;
}

/** Sends the sticks of the first source that moves at 50 Hz, and one release after the last. */
export class Hands {
  // A new server is told once that nothing is held: sticks count only after that.
  private held = true;

  constructor(
    private readonly sources: readonly Source[],
    private readonly send: (message: ToServer) => void,
  ) {
    setInterval(() => this.tick(), PERIOD_MS);
    // A page that is left must not go on flying.
    for (const event of ["blur", "pagehide"]) addEventListener(event, () => this.release());
  }

  /** The connection is new. */
  begin(): void {
    this.held = true;
  }

  private tick(): void {
    const sticks =
      this.sources.map((source) => source.read()).find((each) => !isNeutral(each)) ?? NEUTRAL;
    // A hidden page reads a pad as it was when the page was hidden.
    if (document.hidden || isNeutral(sticks)) {
      this.release();
      return;
    }
    this.held = true;
    this.send({ type: "stick", ...sticks });
  }

  private release(): void {
    if (this.held) this.send({ type: "release" });
    this.held = false;
  }
}
