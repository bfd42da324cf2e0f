import type { FromServer, ToServer } from "./protocol";

const RETRY_MS = 1000;

export interface Listener {
  picture(data: Blob): void;
  message(message: FromServer): void;
  link(up: boolean): void;
}

/** The WebSocket to the console's server; comes back by itself after a loss. */
export class Connection {
  private socket: WebSocket | null = null;

  constructor(private readonly listener: Listener) {
    this.open();
  }

  /** Sends a message; what cannot be sent now is dropped, for it would be old later. */
  send(message: ToServer): void {
    if (this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(message));
    }
  }

  private open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws`);
    this.socket = socket;
    socket.onopen = () => this.listener.link(true);
    socket.onclose = () => {
      this.listener.link(false);
      setTimeout(() => this.open(), RETRY_MS);
    };
    socket.onmessage = (event: MessageEvent<Blob | string>) => {
      if (typeof event.data === "string") {
        this.listener.message(JSON.parse(event.data) as FromServer);
      } else {
        this.listener.picture(event.data);
      }
    };
  }
}
