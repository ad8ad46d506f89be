// The line above everything, and what must not be overlooked: mission, figures, connection, banners.

import { byId, make, setAttribute, setText } from "./dom.js";
import { isTroubled } from "./fleet.js";
import { NOTHING, TASK_STATES, count, metres, number, percent, seconds, stateWord } from "./words.js";

const PHASES = { preparing: "preparing", running: "running", ended: "ended" };
const RESTING = ["home", "out", "lost", "absent"];

export class Header {
  constructor(picture, feed) {
    Object.assign(this, { picture, feed });
    this.parts = TASK_STATES.map((state) => make("i", { class: `task-${state}` }));
    byId("progress").append(...this.parts);
    this.state = "connecting";
    byId("give-token").addEventListener("click", () => feed.introduceAgain());
    setInterval(() => this.showConnection(), 1000);
  }

  show() {
    const { head, mission, uavs, hello } = this.picture;
    const phase = this.phase;
    setText(byId("mission-name"), mission?.name ?? "No mission");
    document.title = mission ? `${mission.name} · Peckorder` : "Peckorder";
    setText(byId("phase"), phase.text);
    setAttribute(byId("phase"), "data-phase", phase.key);
    setText(byId("figure-time"), seconds(head?.mission_s));
    setText(byId("figure-worth"), number(head?.objective));
    setText(
      byId("figure-share"),
      head?.plan?.objective ? `${percent(head.objective / head.plan.objective)} of plan` : "",
    );
    const rows = [...uavs.values()];
    const lost = rows.filter((row) => row.lost).length;
    setText(
      byId("figure-flying"),
      rows.length
        ? String(rows.filter((row) => !RESTING.includes(row.does) && !isTroubled(row)).length)
        : NOTHING,
    );
    setText(
      byId("figure-lost"),
      rows.length ? `of ${rows.length} active${lost ? `, ${lost} lost` : ""}` : "",
    );
    setAttribute(byId("figure-lost"), "class", lost ? "trouble" : null);
    this.#tasks(head?.counts);
    const { now, so_far: soFar } = head?.nearest ?? {};
    setText(byId("figure-near"), now ? metres(now.distance_m) : NOTHING);
    const conflicts = head?.conflicts?.length ?? 0;
    setText(
      byId("figure-nearest"),
      conflicts ? `${count(conflicts, "pair")} about to meet` : soFar ? `least ${metres(soFar.distance_m)}` : "",
    );
    setAttribute(byId("figure-nearest"), "class", conflicts ? "trouble" : null);
    byId("abort").hidden = !(hello?.commands && hello.kind === "live" && mission);
    byId("abort").disabled = Boolean(head?.aborted || head?.phase === "ended");
    this.showConnection();
  }

  /** How far the mission is: a key for its colour, and a word. */
  get phase() {
    const { head, hello, mission } = this.picture;
    if (!mission || !head) return { key: "none", text: "waiting" };
    if (head.aborted) return { key: "aborted", text: head.phase === "ended" ? "aborted" : "aborting" };
    const text = PHASES[head.phase] ?? head.phase ?? "unknown";
    return { key: head.phase ?? "none", text: hello?.kind === "replay" ? `replay · ${text}` : text };
  }

  /** "connecting", "open" or "lost". */
  set connection(state) {
    this.state = state;
    document.body.classList.toggle("stale", state === "lost");
    this.showConnection();
  }

  showConnection() {
    const text = {
      connecting: "connecting",
      open: this.picture.hello?.kind === "replay" ? "recording" : "live",
      lost: "no connection",
    }[this.state];
    setAttribute(byId("connection"), "data-state", this.state);
    setText(byId("connection").lastChild, text);
    this.#banners();
    this.#nothing();
  }

  #tasks(counts) {
    const all = TASK_STATES.reduce((sum, state) => sum + (counts?.[state] ?? 0), 0);
    setText(byId("figure-done"), counts ? String(counts.done) : NOTHING);
    setText(
      byId("figure-tasks"),
      counts ? `of ${all - counts.withdrawn} done${counts.failed ? `, ${counts.failed} failed` : ""}` : "",
    );
    TASK_STATES.forEach((state, index) => {
      this.parts[index].style.flexGrow = String(counts?.[state] ?? 0);
    });
    setAttribute(
      byId("progress"),
      "aria-label",
      counts
        ? `Tasks: ${TASK_STATES.map((state) => `${counts[state] ?? 0} ${stateWord(state)}`).join(", ")}`
        : "No tasks yet",
    );
  }

  #banners() {
    const { head, hello, mission } = this.picture;
    const told = [];
    if (this.state === "lost") {
      const since = new Date(this.feed.lostSince);
      told.push(
        this.feed.ended
          ? [
              "note",
              `The dashboard has ended: ${this.feed.ended}. What you see is from ${since.toLocaleTimeString()}; looking whether it comes back.`,
            ]
          : [
              "lost",
              `Connection lost since ${since.toLocaleTimeString()}. What you see is from then; trying again.`,
            ],
      );
    } else if (head && !head.link && hello?.kind === "live") {
      told.push([
        "lost",
        "The dashboard has lost the bus: nothing new is heard, and commands reach nobody until it is back.",
      ]);
    }
    if (head && this.state === "open") {
      if (!head.coordinator && (head.phase === "running" || head.phase === "preparing")) {
        told.push([
          "warn",
          head.phase === "running"
            ? `Coordinator lost. The fleet goes on with epoch ${head.epoch ?? NOTHING}${hello?.kind === "live" ? "; your commands still reach it" : ""}.`
            : "No coordinator yet: the mission has not begun.",
        ]);
      }
      if (head.aborted && head.phase !== "ended")
        told.push(["warn", "The mission is aborted: every UAV flies home."]);
    }
    if (this.newerServer) told.push(["note", "The dashboard was updated. Reload the page."]);
    if (mission && head?.phase === "ended" && this.state === "open") {
      const { counts } = head;
      told.push([
        "note",
        `Mission ended${head.reason ? `: ${head.reason}` : ""}. ${count(counts?.done ?? 0, "task")} done, worth ${number(head.objective)}.`,
      ]);
    }
    const known = JSON.stringify(told);
    if (known !== this.known) {
      this.known = known;
      byId("banners").replaceChildren(
        ...told.map(([kind, text]) => make("p", { class: `banner ${kind}` }, text, this.#age(kind))),
      );
    }
    if (this.state === "lost" && this.age)
      setText(this.age, ` ${Math.round((Date.now() - this.feed.lostSince) / 1000)} s`);
  }

  /** The seconds of an outage go on silently; a screen reader is told of the outage once. */
  #age(kind) {
    if (kind !== "lost" || this.state !== "lost") return null;
    this.age = make("span", { "aria-hidden": "true" });
    return this.age;
  }

  #nothing() {
    const { head, hello, mission, tasks } = this.picture;
    const text =
      this.state === "connecting"
        ? "Connecting …"
        : !mission && hello?.token && !head
          ? "Waiting for the token."
          : !mission
            ? this.state === "lost"
              ? "No connection to the dashboard."
              : "No mission yet. It appears here as soon as somebody on the bus flies one."
            : "";
    setText(byId("nothing-text"), text);
    byId("nothing").hidden = text === "";
    byId("give-token").hidden = !(this.state === "open" && hello?.token && !head);
    document.body.classList.toggle("unheard", !mission);
    document.body.classList.toggle("empty", tasks.size === 0);
  }
}
