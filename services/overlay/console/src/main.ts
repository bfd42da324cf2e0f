import { Connection } from "./connection";
import { Hands } from "./hands";
import { Keyboard } from "./keyboard";
import { Pad } from "./pad";
import type { Action, State } from "./protocol";
import { Thumbs } from "./thumbs";
import { Video } from "./video";
import { View, element } from "./view";

const view = new View();
const video = new Video(element("picture", HTMLCanvasElement));
let state: State | null = null;

const connection = new Connection({
  picture: (data) => void video.show(data).then(() => connection.send({ type: "shown" })),
  message: (message) => {
    if (message.type === "state") view.state((state = message));
    else if (message.type === "decision") view.answer(message);
    else view.problem(message.error);
  },
  link: (up) => {
    view.link(up);
    if (up) hands.begin();
  },
});

function act(action: Action): void {
  // One nonce a press: the autopilot answers a repeated one without a second effect.
  const nonce = crypto.getRandomValues(new Uint32Array(1))[0] ?? 0;
  const offer = state?.offer;
  if (action === "accept" && offer) {
    connection.send({ type: "decide", action, nonce, suggestion: offer.id });
  } else {
    connection.send({ type: "decide", action, nonce });
  }
}

/** A primitive ends here; `autocomplete dataset record` listens. */
function mark(): void {
  connection.send({ type: "mark" });
}

function onPress(id: string, press: () => void): void {
  const button = element(id, HTMLButtonElement);
  button.addEventListener("click", () => {
    press();
    // Enter and space are keys to fly by, not to press the last button again.
    button.blur();
  });
}

for (const action of ["accept", "cancel", "takeoff", "land", "emergency"] as const) {
  onPress(action, () => act(action));
}
onPress("mark", mark);

const stage = element("stage");
element("picture").addEventListener("dblclick", () => {
  if (document.fullscreenElement) void document.exitFullscreen();
  else void stage.requestFullscreen();
});

const thumbs = new Thumbs(element("left-thumb"), element("right-thumb"));
const hands = new Hands([new Pad(act, mark), new Keyboard(act, mark), thumbs], (message) =>
  connection.send(message),
);
