// The controls of a recording: play, speed, and where in it.

import { byId, make, setAttribute, setText } from "./dom.js";
import { postWithToken } from "./dialogs.js";
import { seconds } from "./words.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16, 32];
/** While the bar is dragged, the place is said this often [ms]. */
const SAY_EVERY_MS = 200;

export class Replay {
  constructor(picture, onRefused) {
    Object.assign(this, { picture, onRefused });
    this.bar = byId("replay");
    this.play = make("button", { type: "button", class: "play", click: () => this.toggle() });
    this.seek = make("input", {
      type: "range",
      min: "0",
      step: "0.1",
      "aria-label": "Place in the recording",
      input: () => this.#drag(),
      change: () => this.#drop(),
    });
    this.time = make("output", { class: "time" });
    this.speed = make(
      "select",
      { "aria-label": "Speed", change: () => this.#say({ speed: Number(this.speed.value) }) },
      ...SPEEDS.map((speed) => make("option", { value: String(speed) }, `${speed} ×`)),
    );
    this.bar.append(this.play, this.seek, this.time, this.speed);
  }

  show() {
    const { hello, head } = this.picture;
    const recording = hello?.kind === "replay" ? head?.recording : null;
    this.bar.hidden = !recording;
    if (!recording) return;
    const duration = hello.duration_s ?? 0;
    this.playing = recording.playing;
    setAttribute(this.play, "aria-label", recording.playing ? "Pause" : "Play");
    setAttribute(this.play, "data-playing", String(recording.playing));
    setAttribute(this.seek, "max", String(duration));
    if (!this.dragged) this.seek.value = String(recording.t_s);
    setAttribute(this.seek, "aria-valuetext", seconds(Number(this.seek.value)));
    setText(this.time, `${seconds(Number(this.seek.value))} / ${seconds(duration)}`);
    if (document.activeElement !== this.speed) this.#showSpeed(recording.speed);
  }

  /** Plays, or stops. */
  toggle() {
    if (!this.bar.hidden) this.#say({ playing: !this.playing });
  }

  #showSpeed(speed) {
    const value = String(speed);
    if (![...this.speed.options].some((option) => option.value === value)) {
      const faster = [...this.speed.options].find((option) => Number(option.value) > speed);
      this.speed.insertBefore(make("option", { value }, `${speed} ×`), faster ?? null);
    }
    this.speed.value = value;
  }

  #drag() {
    this.dragged = true;
    setText(this.time, `${seconds(Number(this.seek.value))} / ${seconds(this.picture.hello.duration_s)}`);
    this.timer ??= setTimeout(() => {
      this.timer = null;
      this.#say({ t_s: Number(this.seek.value) });
    }, SAY_EVERY_MS);
  }

  async #drop() {
    clearTimeout(this.timer);
    this.timer = null;
    await this.#say({ t_s: Number(this.seek.value) });
    this.dragged = false;
  }

  async #say(body) {
    try {
      await postWithToken("api/recording", body);
    } catch (refusal) {
      this.onRefused(refusal.message);
    }
  }
}
