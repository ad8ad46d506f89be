// The buttons on the map, and the mode in which the next click says where a new task is.

import { byId, make, setAttribute, setText } from "./dom.js";
import { countByLayer } from "./layers.js";
import { number } from "./words.js";

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
    this.zone = button("+ Zone", "New zone: then click its corners", "z", () => this.draw(), {
      "aria-pressed": "false",
      id: "add-zone",
    });
    this.lists = button("Lists", "Planned and flown lists on the map", "l", () => this.nextLists());
    this.layer = button("Layers", "Height layers on the map: all, or one after the other", "h", () =>
      this.nextLayer(),
    );
    this.ground = button(
      "Earth",
      "Map of the earth, or the mission's plane in metres",
      null,
      () => this.#ground(),
      { hidden: true, "aria-pressed": "false" },
    );
    byId("map-tools").append(
      this.add,
      this.zone,
      this.lists,
      this.layer,
      this.ground,
      button("Fit", "Show the whole mission", "f", () => map.fit()),
      make(
        "span",
        { class: "pair" },
        button("+", "Zoom in", null, () => map.zoom(1), { "aria-label": "Zoom in" }),
        button("−", "Zoom out", null, () => map.zoom(-1), { "aria-label": "Zoom out" }),
      ),
    );
    this.done = make("button", { type: "button", hidden: true, click: () => this.closed() }, "Done");
    byId("placing").append(
      make("span", {}),
      this.done,
      make("button", { type: "button", click: () => this.leave() }, "Cancel"),
    );
    /** Corners of the zone that is being drawn; null while none is. */
    this.corners = null;
    this.where = "";
  }

  show() {
    const { head, mission } = this.picture;
    this.add.hidden = !this.operator.able || !mission;
    this.add.disabled = Boolean(head?.aborted || head?.phase === "ended");
    this.zone.hidden = this.add.hidden;
    this.zone.disabled = this.add.disabled;
    this.ground.hidden = !this.map.hasEarth;
    setText(
      this.lists,
      { all: "Lists: all", selected: "Lists: chosen", none: "Lists: none" }[this.map.listsShown],
    );
    this.#layers();
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

  /** Begins to draw a zone, or leaves off. */
  draw() {
    if (this.zone.hidden || this.zone.disabled) return;
    if (this.map.isPlacing) this.leave();
    else this.#mode(true, []);
  }

  /** A place was entered by the keyboard: of a zone, with corners enough, it is complete. */
  entered(position) {
    if (this.corners && this.corners.length >= 3) this.closed();
    else this.placed(position);
  }

  /** The zone has all its corners. */
  closed() {
    const { corners } = this;
    if (!corners || corners.length < 3) return;
    this.#mode(false);
    this.map.outline(corners);
    this.operator.addZone(corners)?.then(() => this.map.outline([]));
  }

  /** Takes the place of a new task, or the next corner of a zone. */
  placed(position) {
    if (this.corners) {
      this.corners.push(position);
      this.map.outline(this.corners);
      this.#say();
      return;
    }
    this.#mode(false);
    this.operator.expect({ position, label: "new task" });
    this.operator.addTask(position)?.then((n) => n === null && this.operator.expect());
  }

  nextLists() {
    this.map.showLists(LISTS[(LISTS.indexOf(this.map.listsShown) + 1) % LISTS.length]);
    this.show();
  }

  /** Shows the lowest layer alone, then the next ones, then all again. */
  nextLayer() {
    const count = this.picture.mission?.layers_m?.length ?? 0;
    if (count < 2) return;
    const next = this.map.layer === null ? 0 : this.map.layer + 1;
    this.map.showLayer(next < count ? next : null);
    this.show();
  }

  #layers() {
    const layers = this.picture.mission?.layers_m ?? [];
    this.layer.hidden = layers.length < 2;
    if (this.map.layer !== null && this.map.layer >= layers.length) this.map.showLayer(null);
    if (this.layer.hidden) return;
    const { layer } = this.map;
    const text =
      layer === null
        ? `Layers: all ${layers.length}`
        : `Layer: ${number(layers[layer], 0)} m · ${countByLayer(this.picture.uavs.values(), layers)[layer]}`;
    setText(this.layer, text);
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

  /** Begins or ends to take places; `corners` are those of a zone, null of a task. */
  #mode(on, corners = null) {
    this.map.placing = on;
    this.corners = corners;
    this.map.outline([]);
    setAttribute(this.add, "aria-pressed", String(on && !corners));
    setAttribute(this.zone, "aria-pressed", String(on && Boolean(corners)));
    byId("placing").hidden = !on;
    this.#say();
    if (on) byId("map").focus({ preventScroll: true });
  }

  /** Says what the next click is taken for. */
  #say() {
    const { corners } = this;
    this.done.hidden = !corners;
    this.done.disabled = (corners?.length ?? 0) < 3;
    let text = "";
    if (corners)
      text =
        corners.length < 3
          ? `Click the corners of the zone: ${corners.length} so far.`
          : `${corners.length} corners: more, or Done (Enter).`;
    else if (this.map.isPlacing)
      text = "Click the place of the new task, or bring it under the cross and press Enter.";
    setText(byId("placing").firstChild, text);
  }
}
