// The buttons on the map, and the mode in which the next click says where a new task is.

import { byId, make, setAttribute, setText } from "./dom.js";

const LISTS = ["all", "selected", "none"];

export class MapTools {
  constructor(map, picture, operator) {
    Object.assign(this, { map, picture, operator });
    const button = (text, title, key, click, more = {}) =>
      make(
        "button",
        {
          type: "button",
          title: key ? `${title} (${key})` : title,
          "aria-keyshortcuts": key,
          click,
          ...more,
        },
        text,
      );
    this.add = button("+ Task", "New task: then click its place", "n", () => this.place(), {
      "aria-pressed": "false",
      id: "add-task",
    });
    this.lists = button("Lists", "Planned and flown lists on the map", "l", () => this.nextLists());
    this.ground = button(
      "Earth",
      "Map of the earth, or the mission's plane in metres",
      null,
      () => this.#ground(),
      { hidden: true, "aria-pressed": "false" },
    );
    byId("map-tools").append(
      this.add,
      this.lists,
      this.ground,
      button("Fit", "Show the whole mission", "f", () => map.fit()),
      make(
        "span",
        { class: "pair" },
        button("+", "Zoom in", null, () => map.zoom(1), { "aria-label": "Zoom in" }),
        button("−", "Zoom out", null, () => map.zoom(-1), { "aria-label": "Zoom out" }),
      ),
    );
    byId("placing").append(
      make("span", {}),
      make("button", { type: "button", click: () => this.leave() }, "Cancel"),
    );
    this.where = "";
  }

  show() {
    const { head, mission } = this.picture;
    this.add.hidden = !this.operator.able || !mission;
    this.add.disabled = Boolean(head?.aborted || head?.phase === "ended");
    this.ground.hidden = !this.map.hasEarth;
    setText(
      this.lists,
      { all: "Lists: all", selected: "Lists: chosen", none: "Lists: none" }[this.map.listsShown],
    );
    this.#legend();
  }

  /** Begins to place a task, or leaves off. */
  place() {
    if (this.add.hidden || this.add.disabled) return;
    if (this.map.isPlacing) this.leave();
    else this.#mode(true);
  }

  /** Leaves the mode; whether it was on. */
  leave() {
    const was = Boolean(this.map.isPlacing);
    this.#mode(false);
    return was;
  }

  /** Takes the place of a new task. */
  placed(position) {
    this.#mode(false);
    this.operator.expect({ position, label: "new task" });
    this.operator.addTask(position)?.then((n) => n === null && this.operator.expect());
  }

  nextLists() {
    this.map.showLists(LISTS[(LISTS.indexOf(this.map.listsShown) + 1) % LISTS.length]);
    this.show();
  }

  /** Shows where the pointer is. */
  readout(text) {
    this.where = text;
    this.#legend();
  }

  #legend() {
    const { head } = this.picture;
    const epoch = head?.rule ? `${head.rule} · epoch ${head.epoch ?? "–"}` : "";
    setText(byId("legend"), [this.where, epoch].filter(Boolean).join("   "));
  }

  #ground() {
    const onEarth = this.map.projection.name !== "earth";
    this.map.project(onEarth);
    setAttribute(this.ground, "aria-pressed", String(onEarth));
  }

  #mode(on) {
    this.map.placing = on;
    setAttribute(this.add, "aria-pressed", String(on));
    byId("placing").hidden = !on;
    setText(
      byId("placing").firstChild,
      on ? "Click the place of the new task, or bring it under the cross and press Enter." : "",
    );
    if (on) byId("map").focus({ preventScroll: true });
  }
}
