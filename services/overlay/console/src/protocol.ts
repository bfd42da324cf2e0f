// What the console's server and this page say to one another (services/overlay/protocol.py).

export interface Offer {
  id: number;
  primitive: string;
  confidence: number;
  speed_mps: number;
  fit_rms_m: number;
}

export interface State {
  type: "state";
  vehicle_name: string;
  mode: string;
  reason: string;
  progress_m: number;
  cross_track_m: number;
  offer: Offer | null;
  advice: string;
  label: string;
  probabilities: Record<string, number>;
  vehicle_state: string;
  battery: number | null;
  collisions: number;
  world: string;
  pose_status: string;
  ages_s: Record<string, number | null>;
  stale: string[];
  alive: string[];
  linked: boolean;
  pad: "free" | "yours" | "busy" | "stale";
}

export interface Answer {
  type: "decision";
  nonce: number;
  ok: boolean;
  reason: string;
}

export interface Problem {
  type: "error";
  error: string;
}

export type FromServer = State | Answer | Problem;

export type Action = "accept" | "cancel" | "takeoff" | "land" | "emergency";

/** Fractions of full stick: forward, left, up, counter-clockwise. */
export interface Sticks {
  vx: number;
  vy: number;
  vz: number;
  wz: number;
}

export const NEUTRAL: Sticks = { vx: 0, vy: 0, vz: 0, wz: 0 };

export type ToServer =
  | ({ type: "stick" } & Sticks)
  | { type: "release" }
  | { type: "mark" }
  | { type: "shown" }
  | { type: "decide"; action: Action; nonce: number; suggestion?: number };
