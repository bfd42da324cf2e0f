import type { Source } from "./hands";
import type { Sticks } from "./protocol";

/** One thumb pad on the screen: x to the right and y up, -1..1. */
class Thumb {
  x = 0;
  y = 0;

  constructor(private readonly element: HTMLElement) {
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      this.move(event);
    });
    element.addEventListener("pointermove", (event) => {
      if (element.hasPointerCapture(event.pointerId)) this.move(event);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(end, () => this.set(0, 0));
    }
  }

  private move(event: PointerEvent): void {
    const box = this.element.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / box.height) * 2;
    const size = Math.max(1, Math.hypot(x, y));
    this.set(x / size, y / size);
  }

  private set(x: number, y: number): void {
    this.x = x;
    this.y = y;
    this.element.style.setProperty("--x", x.toFixed(3));
    this.element.style.setProperty("--y", y.toFixed(3));
  }
}

/** Two thumb pads, as on a pad: left moves, right climbs and turns. */
export class Thumbs implements Source {
  private readonly left: Thumb;
  private readonly right: Thumb;

  constructor(left: HTMLElement, right: HTMLElement) {
    this.left = new Thumb(left);
    this.right = new Thumb(right);
  }

  read(): Sticks {
    const { left, right } = this;
    return { vx: left.y, vy: -left.x, vz: right.y, wz: -right.x };
  }
}
