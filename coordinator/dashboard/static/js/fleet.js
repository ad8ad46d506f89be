// The fleet as a table: who does what, when it will be done, and how well it can be heard.

import { uavColour } from "./colours.js";
import { make, setAttribute, setText } from "./dom.js";
import { Grid } from "./grid.js";
import { DOES, NOTHING, byName, number, percent, seconds } from "./words.js";

const LOW_BATTERY = 0.2;
const LONG_SILENCE_S = 3;

export class FleetTable {
  constructor(panel, picture, onSelect) {
    this.panel = panel;
    this.picture = picture;
    const done = (row) => picture.lists.get(row.id)?.flown.length ?? 0;
    this.grid = new Grid(panel, {
      label: "Fleet",
      empty: "No UAV is known yet.",
      onSelect: (id) => onSelect("uav", id),
      decorate: (slot, row) => setAttribute(slot, "data-trouble", isTroubled(row) ? "" : null),
      columns: [
        {
          id: "uav",
          title: "UAV",
          value: (row) => row.id,
          rank: (row) => row.id,
          draw: (cell, row) => this.#drawName(cell, row),
        },
        { id: "does", title: "Does", value: doing, rank: doing, draw: drawDoing },
        {
          id: "task",
          title: "Task",
          hint: "Or the base that it flies to, or stands at",
          value: (row) => row.task ?? row.base ?? NOTHING,
          rank: (row) => row.task ?? row.base,
        },
        {
          id: "eta",
          title: "In",
          hint: "Until its task is done",
          value: (row) => seconds(doneIn(row, picture)),
          rank: (row) => row.completion_s,
        },
        {
          id: "battery",
          title: "Battery",
          value: (row) => percent(row.battery),
          rank: (row) => row.battery,
          draw: drawBattery,
        },
        {
          id: "left",
          title: "Left",
          hint: "How long it may fly on before it has to land, its reserve kept",
          value: (row) => seconds(sortieLeft(row, picture)),
          rank: (row) => row.sortie_end_s,
        },
        {
          id: "heard",
          title: "Heard",
          hint: "How long ago it last said something",
          value: heard,
          rank: (row) => row.silent_s,
          draw: drawHeard,
        },
        {
          id: "done",
          title: "Done",
          hint: "Tasks it has done",
          value: (row) => String(done(row)),
          rank: done,
        },
        { id: "note", title: "Note", value: note, draw: drawNote },
        {
          id: "place",
          title: "Place",
          hint: "Metres east and north",
          value: where,
          rank: (row) => row.position?.[0] ?? null,
        },
      ],
    });
  }

  show() {
    if (this.panel.hidden) return;
    const rank = new Map((this.picture.head?.sequence ?? []).map((id, index) => [id, index]));
    const last = rank.size;
    this.grid.show(
      [...this.picture.uavs.values()].sort(
        (one, other) => (rank.get(one.id) ?? last) - (rank.get(other.id) ?? last) || byName(one.id, other.id),
      ),
    );
  }

  #drawName(cell, row) {
    const dot = make("i", { class: "dot", "aria-hidden": "true" });
    dot.style.background = uavColour(this.picture.described(row.id).number);
    cell.replaceChildren(dot, row.id);
  }

  /** Colours have changed: names are drawn anew. */
  recolour() {
    for (const slot of this.grid.slots) slot.children[0].shownValue = undefined;
    this.show();
  }
}

export function isTroubled(row) {
  return row.lost || row.does === "lost" || row.does === "out";
}

function doing(row) {
  return row.lost ? "lost" : (row.visit ?? row.does);
}

/** Until the task of a UAV is done, as it predicts [s]; null where it has none. */
export function doneIn(row, picture) {
  const now = picture.head?.mission_s;
  return row.completion_s === null || now === null || now === undefined ? null : row.completion_s - now;
}

/** For how long a UAV may fly on [s]; null where that is endless or not known. */
export function sortieLeft(row, picture) {
  const now = picture.head?.mission_s;
  if (row.sortie_end_s === null || row.sortie_end_s === undefined || now === null) return null;
  return Math.max(0, row.sortie_end_s - now);
}

/** Sign and word of what a UAV does. */
export function drawDoing(cell, row) {
  const [sign, mood] = DOES[doing(row)] ?? ["○", "rest"];
  cell.replaceChildren(
    make("span", { class: `state ${mood}` }, make("i", { "aria-hidden": "true" }, sign), doing(row)),
  );
}

function drawBattery(cell, row, text) {
  if (row.battery === null) {
    setText(cell, NOTHING);
    return;
  }
  const meter = make("span", { class: "meter", "aria-hidden": "true" }, make("i", {}));
  meter.firstChild.style.width = percent(row.battery);
  cell.replaceChildren(meter, text);
  cell.classList.toggle("warn", row.battery < LOW_BATTERY);
}

function heard(row) {
  return row.silent_s === null ? "never" : seconds(row.silent_s);
}

function drawHeard(cell, row, text) {
  setText(cell, text);
  cell.classList.toggle("warn", row.silent_s === null || row.silent_s > LONG_SILENCE_S);
}

function where(row) {
  return row.position ? `${number(row.position[0], 0)}, ${number(row.position[1], 0)}` : NOTHING;
}

function note(row) {
  return row.note || (row.present || row.lost ? "" : "not there");
}

function drawNote(cell, row, text) {
  setText(cell, text);
  cell.title = text;
}
