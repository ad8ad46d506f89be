// The card of what is selected: all that is known of a UAV or a task, and what can be done with it.

import { choiceDetails, concerns } from "./choices.js";
import { uavColour } from "./colours.js";
import { make } from "./dom.js";
import { doneIn, drawDoing, sortieLeft } from "./fleet.js";
import { degreesOf } from "./frames.js";
import { reasons } from "./links.js";
import { drawTaskState } from "./tasks.js";
import { NOTHING, TASK_SIGNS, degrees, number, percent, place, seconds, stateWord, taskState } from "./words.js";

const LAST_CHOICES = 3;

/** How high a UAV is above the origin, and its layer. */
function heightOf(row, { layer_m: layer }) {
  const above = row.height_m === null ? NOTHING : `${number(row.height_m)} m`;
  return layer === undefined ? above : `${above}, layer ${number(layer)} m`;
}

export class Card {
  /** `on`: `{select(kind, id), centre(position), choices(of), close()}`. */
  constructor(element, picture, operator, on) {
    Object.assign(this, { element, picture, operator, on });
    this.of = null;
  }

  select(of) {
    this.of = of;
    this.element.hidden = of === null;
    this.known = null;
    if (of) this.#build();
    else this.element.replaceChildren();
  }

  /** Shows news of what is selected. */
  show(changed) {
    if (!this.of) return;
    if (changed.whole && !this.#row()) this.on.close();
    else this.#build();
  }

  #row() {
    return (this.of.kind === "uav" ? this.picture.uavs : this.picture.tasks).get(this.of.id);
  }

  #build() {
    const row = this.#row();
    if (!row) return;
    if (!this.known) this.#frame(row);
    const sections = this.of.kind === "uav" ? this.#uav(row) : this.#task(row);
    // Parts are made anew only where they tell something new, so that nothing under a finger moves.
    for (const [name, key, build] of sections) {
      const told = JSON.stringify(key);
      if (this.known.get(name) === told) continue;
      this.known.set(name, told);
      const built = build();
      this.parts.get(name)?.replaceChildren(...[built].flat().filter(Boolean));
    }
  }

  #frame(row) {
    this.known = new Map();
    this.parts = new Map(
      ["state", "actions", "facts", "lists", "choices"].map((name) => [
        name,
        make("div", { class: `card-${name}` }),
      ]),
    );
    const close = make(
      "button",
      {
        type: "button",
        class: "quiet",
        "aria-label": "Close",
        title: "Close (Esc)",
        click: () => this.on.close(),
      },
      "×",
    );
    const centre = make(
      "button",
      {
        type: "button",
        class: "quiet",
        title: "Bring it to the middle of the map",
        click: () => this.on.centre(this.#row()?.position),
      },
      "Show on map",
    );
    const name = make("h2", {}, row.id);
    if (this.of.kind === "uav") {
      const dot = make("i", { class: "dot", "aria-hidden": "true" });
      dot.style.background = uavColour(this.picture.described(row.id).number);
      name.prepend(dot);
    }
    this.element.setAttribute("aria-label", `${this.of.kind === "uav" ? "UAV" : "Task"} ${row.id}`);
    this.element.replaceChildren(
      make("header", {}, name, this.parts.get("state"), make("span", { class: "gap" }), centre, close),
      this.parts.get("actions"),
      this.parts.get("facts"),
      this.parts.get("lists"),
      this.parts.get("choices"),
    );
  }

  #uav(row) {
    const { picture } = this;
    const described = picture.described(row.id);
    const list = picture.lists.get(row.id) ?? { planned: [], flown: [] };
    const rank = (picture.head?.sequence ?? []).indexOf(row.id);
    const { origin } = picture.mission ?? {};
    const task = picture.tasks.get(row.task);
    const facts = [
      ["Task", row.task ? this.#go("task", row.task) : NOTHING, row.task],
      ["Done in", seconds(doneIn(row, picture))],
      ["Claim", row.claim ?? NOTHING],
      ["Rank", rank < 0 ? NOTHING : `${rank + 1} of ${picture.head.sequence.length}`],
      ["Rule", picture.head?.rule ?? NOTHING],
      ["Place", place(row.position)],
      origin && row.position ? ["WGS84", degrees(degreesOf(origin, row.position))] : null,
      [
        "Speed",
        row.velocity
          ? `${number(Math.hypot(...row.velocity))} of ${number(described.speed_m_s)} m/s`
          : `${number(described.speed_m_s)} m/s at most`,
      ],
      ["Battery", percent(row.battery)],
      row.base ? ["Base", `${row.base}, ${row.stage}`] : null,
      row.sortie_end_s ? ["May fly on for", seconds(sortieLeft(row, picture))] : null,
      described.endurance_s ? ["Batteries changed", String(row.swaps ?? 0)] : null,
      ["Heard", row.silent_s === null ? "never" : `${seconds(row.silent_s)} ago`],
      described.kind ? ["Kind", described.kind] : null,
      ["Height", heightOf(row, described)],
      row.command ? ["Operator", row.command] : null,
      row.note ? ["Note", row.note] : null,
      Object.keys(row.dropped ?? {}).length ? ["Dropped", reasons(row.dropped)] : null,
    ].filter(Boolean);
    const sets = [...list.planned, ...list.flown].map((id) => [id, picture.tasks.get(id)?.state]);
    return [
      ["state", [row.does, row.visit, row.lost], () => this.#drawn(drawDoing, row)],
      [
        "actions",
        [row.does, row.claim, row.lost, row.stage, this.operator.able, picture.head?.phase],
        () => this.#uavActions(row),
      ],
      ["facts", facts.map(([title, value, key]) => [title, key ?? String(value)]), () => definition(facts)],
      [
        "lists",
        [list, sets, task?.state],
        () => [this.#chips("Planned", list.planned), this.#chips("Flown", list.flown)],
      ],
      ["choices", this.#choicesKey(), () => this.#choices()],
    ];
  }

  #task(row) {
    const { picture } = this;
    const { origin } = picture.mission ?? {};
    const planners = [...picture.lists.values()]
      .filter((list) => list.planned.includes(row.id))
      .map((list) => list.uav);
    const state = taskState(row);
    const who = { taken: "Taken by", done: "Done by", failed: "Failed by" }[state] ?? "UAV";
    const facts = [
      [who, row.uav ? this.#go("uav", row.uav) : NOTHING, row.uav],
      ["Planned for", planners.length ? this.#go("uav", planners[0]) : NOTHING, planners[0]],
      row.left_out ? ["Left out", row.why] : null,
      ["Value", number(row.value)],
      ["Service", seconds(row.service_s)],
      ["Kind", row.kind ?? NOTHING],
      row.opens_s ? ["Opens at", seconds(row.opens_s)] : null,
      row.closes_s === null ? null : ["Closes at", seconds(row.closes_s)],
      row.due_s === null ? null : ["Due by", seconds(row.due_s)],
      row.height_m === null ? null : ["Height", `${number(row.height_m)} m`],
      row.path?.length ? ["Line", `${row.path.length} points`] : null,
      ["Done at", seconds(row.completed_s)],
      ["Place", place(row.position)],
      origin ? ["WGS84", degrees(degreesOf(origin, row.position))] : null,
      ["Added by", row.by],
    ].filter(Boolean);
    return [
      ["state", [state, row.left_out], () => this.#drawn(drawTaskState, row)],
      ["actions", [row.state, this.operator.able], () => this.#taskActions(row)],
      ["facts", facts.map(([title, value, key]) => [title, key ?? String(value)]), () => definition(facts)],
      ["choices", this.#choicesKey(), () => this.#choices()],
    ];
  }

  #drawn(drawer, row) {
    const cell = make("span", {});
    drawer(cell, row);
    return cell;
  }

  #uavActions(row) {
    if (!this.operator.able) return [];
    const gone = ["home", "out", "lost", "absent", "returning"].includes(row.does);
    const action = (kind, title, off) =>
      make(
        "button",
        { type: "button", disabled: off, click: () => this.operator.command(kind, row.id) },
        title,
      );
    return [
      row.does === "holding"
        ? action("resume", "Resume", false)
        : action("hold", "Hold", gone && row.does !== "returning"),
      row.does === "holding" ? null : action("resume", "Resume", row.claim !== "paused"),
      action("return", "Return home", gone),
      ["landed", "parked"].includes(row.stage) ? action("ready", "Ready", false) : null,
      this.picture.head?.phase === "preparing" && row.claim === null
        ? action("start", "Start without it", false)
        : null,
    ];
  }

  #taskActions(row) {
    if (!this.operator.able) return [];
    return [
      make(
        "button",
        { type: "button", disabled: row.state !== "open", click: () => this.operator.withdraw(row.id) },
        "Withdraw",
      ),
    ];
  }

  #chips(title, ids) {
    if (!ids.length) return null;
    const chips = ids.map((id) => {
      const task = this.picture.tasks.get(id);
      const state = task ? taskState(task) : "open";
      const button = this.#go("task", id);
      button.className = `chip-task task-${state}`;
      button.prepend(make("i", { "aria-hidden": "true" }, TASK_SIGNS[state]));
      button.setAttribute("aria-label", `${id}, ${stateWord(state, task)}`);
      return make("li", {}, button);
    });
    return make(
      "section",
      {},
      make("h3", {}, `${title} ${ids.length}`),
      make("ol", { class: "chips" }, ...chips),
    );
  }

  #choicesKey() {
    return this.picture.choices
      .filter((choice) => concerns(choice, this.of))
      .slice(-LAST_CHOICES)
      .map((choice) => choice.n);
  }

  #choices() {
    const mine = this.picture.choices.filter((choice) => concerns(choice, this.of)).reverse();
    if (!mine.length) return [];
    const more = make(
      "button",
      { type: "button", class: "link", click: () => this.on.choices(this.of) },
      mine.length > LAST_CHOICES ? `all ${mine.length}` : "in the log",
    );
    return [
      make("h3", {}, "Last decisions ", more),
      make(
        "ol",
        { class: "log choices" },
        ...mine.slice(0, LAST_CHOICES).map((choice) => make("li", {}, choiceDetails(choice, this.on.select))),
      ),
    ];
  }

  #go(kind, id) {
    return make("button", { type: "button", class: "link", click: () => this.on.select(kind, id) }, id);
  }
}

function definition(facts) {
  return make(
    "dl",
    { class: "facts" },
    ...facts.map(([title, value]) => make("div", {}, make("dt", {}, title), make("dd", {}, value))),
  );
}
