// The task board as a table, whole or by state.

import { make, setAttribute } from "./dom.js";
import { Grid } from "./grid.js";
import { NOTHING, TASK_SIGNS, TASK_STATES, number, seconds, stateWord, taskState } from "./words.js";

export class TaskTable {
  constructor(panel, picture, onSelect) {
    this.panel = panel;
    this.picture = picture;
    this.only = null;
    this.filters = new Map();
    const bar = make("div", { class: "filters", role: "group", "aria-label": "Which tasks" });
    for (const state of [null, ...TASK_STATES]) {
      const button = make("button", {
        type: "button",
        class: "pill",
        "aria-pressed": String(state === null),
        click: () => this.#filter(state),
      });
      this.filters.set(state, button);
      bar.append(button);
    }
    panel.append(bar);
    this.grid = new Grid(panel, {
      label: "Tasks",
      empty: "No such task.",
      onSelect: (id) => onSelect("task", id),
      decorate: (slot, row) => setAttribute(slot, "data-trouble", row.state === "failed" ? "" : null),
      columns: [
        { id: "task", title: "Task", value: (row) => row.id, rank: (row) => row.id },
        {
          id: "state",
          title: "State",
          value: (row) => stateWord(taskState(row), row),
          rank: (row) => TASK_STATES.indexOf(taskState(row)),
          draw: drawTaskState,
        },
        { id: "uav", title: "UAV", value: (row) => row.uav ?? NOTHING, rank: (row) => row.uav },
        { id: "value", title: "Value", value: (row) => number(row.value), rank: (row) => row.value },
        {
          id: "ended",
          title: "Done at",
          value: (row) => seconds(row.completed_s),
          rank: (row) => row.completed_s,
        },
        {
          id: "service",
          title: "Service",
          hint: "How long it takes there",
          value: (row) => (row.service_s ? seconds(row.service_s) : NOTHING),
          rank: (row) => row.service_s,
        },
        { id: "kind", title: "Kind", value: (row) => row.kind ?? NOTHING, rank: (row) => row.kind },
        {
          id: "by",
          title: "By",
          hint: "Who put it on the board",
          value: (row) => row.by,
          rank: (row) => row.by,
        },
      ],
    });
    this.show({ whole: true, tasks: new Set() });
  }

  show(changed) {
    if (this.panel.hidden || (!changed.whole && !changed.tasks.size)) return;
    const rows = this.picture.tasksInOrder;
    const counts = new Map();
    for (const row of rows) counts.set(taskState(row), (counts.get(taskState(row)) ?? 0) + 1);
    for (const [state, button] of this.filters) {
      const many = state === null ? rows.length : (counts.get(state) ?? 0);
      const text = state === null ? `All ${many}` : `${TASK_SIGNS[state]} ${stateWord(state)} ${many}`;
      if (button.textContent !== text) button.textContent = text;
      button.hidden = state !== null && many === 0 && this.only !== state;
    }
    const shown = this.only === null ? rows : rows.filter((row) => taskState(row) === this.only);
    this.grid.show(shown);
  }

  #filter(state) {
    this.only = state;
    for (const [each, button] of this.filters) setAttribute(button, "aria-pressed", String(each === state));
    this.show({ whole: true, tasks: new Set() });
  }
}

/** Sign and word of a task's state. */
export function drawTaskState(cell, row) {
  const state = taskState(row);
  cell.replaceChildren(
    make(
      "span",
      { class: `state task-${state}`, title: row.why },
      make("i", { "aria-hidden": "true" }, TASK_SIGNS[state]),
      stateWord(state, row),
    ),
  );
}
