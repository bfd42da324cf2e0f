import type { Answer, State } from "./protocol";

const PICTURE_GONE_S = 1;
const ANSWER_SHOWN_MS = 4000;
/** A charge below this is a warning, as in the picture's strip. */
const BATTERY_LOW = 0.2;

/** What a person does about a refusal; the autopilot's other reasons read well as they are. */
const REFUSALS: Readonly<Record<string, string>> = {
  stick: "let go of the sticks first",
  stick_lost: "no sticks arrive",
  unknown: "nothing is suggested",
  stale: "the suggestion is too old, fly on",
  pose_lost: "the vehicle does not know where it is",
  battery_low: "the battery is too low",
  plant: "this vehicle cannot fly paths",
  late: "the autopilot stood still, try again",
};

/** The page's element with an id, of a kind if one is given. */
export function element(id: string): HTMLElement;
export function element<E extends HTMLElement>(id: string, kind: new () => E): E;
export function element(id: string, kind = HTMLElement): HTMLElement {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`the page has no ${kind.name} #${id}`);
  return found;
}

function percent(fraction: number): string {
  return `${Math.round(100 * fraction)} %`;
}

function ago(age_s: number | null): string {
  if (age_s === null) return "never";
  return age_s < 1 ? `${Math.round(1000 * age_s)} ms` : `${age_s.toFixed(0)} s`;
}

/** Everything around the picture. */
export class View {
  private readonly bars = new Map<string, HTMLElement>();
  private answerUntil_ms = 0;

  link(up: boolean): void {
    document.body.dataset["link"] = up ? "up" : "down";
    element("link").textContent = up ? "connected" : "no console server";
    if (!up) this.veil("No connection to the console's server");
  }

  state(state: State): void {
    document.title = `${state.mode} · Autocomplete`;
    document.body.dataset["mode"] = state.mode;
    document.body.dataset["network"] = state.linked ? "up" : "down";
    if (!state.linked) element("link").textContent = "no router";
    else element("link").textContent = "connected";
    element("vehicle").textContent = state.vehicle_name;
    element("mode").textContent = state.mode;
    element("reason").textContent = state.reason.replaceAll("_", " ");
    this.offer(state);
    this.intent(state);
    this.facts(state);
    element("pad").textContent = {
      free: "free: move a stick to fly",
      yours: "you fly",
      busy: "another console flies",
      stale: "let go first: the link had a gap",
    }[state.pad];
    element("services").replaceChildren(
      ...state.alive.map((name) => Object.assign(document.createElement("li"), { textContent: name })),
    );
    const age_s = state.ages_s["camera/front"] ?? null;
    this.veil(age_s !== null && age_s < PICTURE_GONE_S ? "" : "Waiting for pictures");
    if (performance.now() > this.answerUntil_ms) element("answer").textContent = "";
  }

  private veil(text: string): void {
    element("veil").textContent = text;
    element("veil").hidden = text === "";
  }

  answer(answer: Answer): void {
    const line = element("answer");
    const reason = answer.reason.replaceAll("_", " ");
    line.textContent = answer.ok ? `Done: ${reason}` : `Refused: ${REFUSALS[answer.reason] ?? reason}`;
    line.dataset["ok"] = String(answer.ok);
    this.answerUntil_ms = performance.now() + ANSWER_SHOWN_MS;
  }

  problem(error: string): void {
    this.answer({ type: "decision", nonce: 0, ok: false, reason: error });
  }

  private offer(state: State): void {
    const { offer } = state;
    const engaged = state.mode === "engaged";
    element("offer").dataset["state"] = engaged ? "engaged" : offer ? "offered" : "none";
    element("offer-shape").textContent = offer ? offer.primitive : "none";
    element("offer-detail").textContent = engaged
      ? `${state.progress_m.toFixed(1)} m flown, ${(100 * Math.abs(state.cross_track_m)).toFixed(0)} cm beside it`
      : offer
        ? `${percent(offer.confidence)} sure, ${offer.speed_mps.toFixed(1)} m/s, fit ${(100 * offer.fit_rms_m).toFixed(0)} cm`
        : "Fly a shape for two seconds.";
    element("offer-advice").textContent = state.advice;
    element("accept", HTMLButtonElement).disabled = offer === null || engaged;
  }

  private intent(state: State): void {
    for (const [name, probability] of Object.entries(state.probabilities)) {
      let bar = this.bars.get(name);
      if (bar === undefined) {
        bar = document.createElement("div");
        bar.className = "bar";
        bar.append(
          Object.assign(document.createElement("span"), { textContent: name }),
          document.createElement("meter"),
        );
        this.bars.set(name, bar);
        element("intent").append(bar);
      }
      bar.dataset["chosen"] = String(name === state.label);
      const meter = bar.querySelector("meter");
      if (meter !== null) meter.value = probability;
    }
    element("intent").dataset["label"] = state.label;
  }

  private facts(state: State): void {
    this.list("facts", [
      ["state", state.vehicle_state.replaceAll("_", " "), false],
      ["world", state.world || "unknown", false],
      [
        "battery",
        state.battery === null ? "unknown" : percent(state.battery),
        state.battery !== null && state.battery < BATTERY_LOW,
      ],
      ["collisions", String(state.collisions), state.collisions > 0],
      ["pose", state.pose_status, state.pose_status !== "ok"],
    ]);
    this.list(
      "ages",
      Object.entries(state.ages_s).map(([topic, age_s]) => [
        topic.replace("/", " "),
        ago(age_s),
        state.stale.includes(topic),
      ]),
    );
  }

  private list(id: string, facts: [string, string, boolean][]): void {
    element(id).replaceChildren(
      ...facts.flatMap(([name, text, isBad]) => {
        const value = Object.assign(document.createElement("dd"), { textContent: text });
        value.classList.toggle("bad", isBad);
        return [Object.assign(document.createElement("dt"), { textContent: name }), value];
      }),
    );
  }
}
