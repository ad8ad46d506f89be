// The websocket that tells the page everything; comes back by itself, sooner at first.

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;
/** Close code of a server that wants another token. */
const WRONG_TOKEN = 4401;
/** A feed that has told frames tells two a second; after this long its server hangs. */
const SILENCE_MS = 5000;

export class Feed {
  /**
   * @param onMessage called with every message.
   * @param onState called with "connecting", "open" or "lost".
   * @param askToken resolves to the token, or to null when the person has none; takes whether the
   *     last one was wrong.
   */
  constructor(onMessage, onState, askToken) {
    Object.assign(this, { onMessage, onState, askToken });
    /** Why the server has ended, as it said itself; null for any other end of the connection. */
    this.ended = null;
    /** Wall time since which there is no connection; null while there is one. */
    this.lostSince = null;
    this.url = new URL("feed", document.baseURI);
    this.url.protocol = this.url.protocol.replace("http", "ws");
    this.waitMs = FIRST_WAIT_MS;
    window.addEventListener("online", () => this.#hurry());
    document.addEventListener("visibilitychange", () => document.hidden || this.#hurry());
    setInterval(() => this.#watch(), 1000);
  }

  open() {
    clearTimeout(this.timer);
    const socket = new WebSocket(this.url);
    this.socket = socket;
    this.heardAt = null;
    socket.onmessage = (event) => this.#hear(socket, event.data);
    socket.onclose = (event) => this.#lose(socket, event.code === WRONG_TOKEN && this.given === socket);
  }

  /** Gives the token where one is wanted; without one nothing comes. */
  async #introduce(socket) {
    const token = await this.askToken(this.refused ?? false);
    this.refused = false;
    if (token === null || socket.readyState !== WebSocket.OPEN) return;
    this.given = socket;
    socket.send(JSON.stringify({ type: "token", token }));
  }

  /** Asks for the token once more, after the person had none. */
  introduceAgain() {
    if (this.socket) this.#introduce(this.socket);
  }

  #hear(socket, data) {
    if (socket !== this.socket) return;
    let message;
    try {
      message = JSON.parse(data);
    } catch {
      console.warn("a message of the feed is not JSON and was passed over");
      return;
    }
    if (message.type === "hello") {
      this.waitMs = FIRST_WAIT_MS;
      this.lostSince = null;
      this.ended = null;
      this.onState("open");
      if (message.token) this.#introduce(socket);
    }
    if (message.type === "end") this.ended = message.reason;
    if (message.type === "frame") this.heardAt = performance.now();
    this.onMessage(message);
  }

  #lose(socket, refused = false) {
    if (socket !== this.socket) return;
    this.refused = refused;
    this.socket = null;
    this.lostSince ??= Date.now();
    this.onState("lost");
    this.timer = setTimeout(() => this.open(), this.waitMs * (0.8 + 0.4 * Math.random()));
    this.waitMs = Math.min(2 * this.waitMs, LONGEST_WAIT_MS);
  }

  #hurry() {
    this.waitMs = FIRST_WAIT_MS;
    if (!this.socket) this.open();
  }

  #watch() {
    const { socket, heardAt } = this;
    if (!socket || heardAt === null || document.hidden) return;
    if (performance.now() - heardAt > SILENCE_MS) {
      socket.onclose = null;
      socket.close();
      this.#lose(socket);
    }
  }
}
