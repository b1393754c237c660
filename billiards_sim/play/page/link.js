// SPDX-License-Identifier: Apache-2.0
// The line to the server, and the position in the address bar.

const AGAIN = 1000; // ms until a lost connection is tried again

/** A WebSocket that asks and is answered, and that comes back by itself. */
export class Server {
  /** `tell` takes what every page is told, `state` whether the line is up. */
  constructor(tell, state) {
    this.tell = tell;
    this.state = state;
    this.waiting = new Map();
    this.next = 1;
    this.connect();
  }

  connect() {
    this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
    this.socket.addEventListener("open", () => this.state(true));
    this.socket.addEventListener("message", (event) => this.heard(JSON.parse(event.data)));
    this.socket.addEventListener("close", () => {
      for (const answer of this.waiting.values()) answer({ error: "the connection is lost" });
      this.waiting.clear();
      this.state(false);
      setTimeout(() => this.connect(), AGAIN);
    });
  }

  heard(message) {
    if (message.tell) {
      this.tell(message);
    } else if (this.waiting.has(message.id)) {
      this.waiting.get(message.id)(message);
      this.waiting.delete(message.id);
    } else if (message.error) {
      this.tell({ tell: "said", error: message.error });
    }
  }

  /** Ask; the promise holds the answer, which has `error` where it cannot be done. */
  ask(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.resolve({ error: "the server does not answer" });
    const id = this.next;
    this.next += 1;
    this.socket.send(JSON.stringify({ id, ...message }));
    return new Promise((resolve) => {
      this.waiting.set(id, resolve);
    });
  }
}

/** What an address bar can hold: JSON in letters that need no escape. */
export function encoded(value) {
  const bytes = new TextEncoder().encode(JSON.stringify(value));
  const text = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return text.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** What `encoded` was given; null where it is nothing of the kind. */
export function decoded(text) {
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (one) => one.charCodeAt(0));
    return JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    return null;
  }
}
