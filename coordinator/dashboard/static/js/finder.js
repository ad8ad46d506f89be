// Finding a UAV or a task by its id.

import { byId, make, setAttribute } from "./dom.js";
import { byName } from "./words.js";

const MOST = 8;

export class Finder {
  constructor(picture, onSelect) {
    Object.assign(this, { picture, onSelect });
    this.input = byId("find");
    this.list = byId("found");
    this.input.addEventListener("input", () => this.#look());
    this.input.addEventListener("keydown", (event) => this.#key(event));
    this.input.addEventListener("blur", () => setTimeout(() => this.#close(), 150));
    this.list.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      const at = [...this.list.children].indexOf(event.target.closest("li"));
      if (at >= 0) this.#take(at);
    });
  }

  focus() {
    this.input.focus();
    this.input.select();
  }

  #look() {
    const wanted = this.input.value.trim().toLowerCase();
    this.found = wanted
      ? [
          ...this.#matches("uav", this.picture.uavs, wanted),
          ...this.#matches("task", this.picture.tasks, wanted),
        ].slice(0, MOST)
      : [];
    this.chosen = 0;
    this.#show();
  }

  #matches(kind, rows, wanted) {
    const rank = (id) => (id.toLowerCase() === wanted ? 0 : id.toLowerCase().startsWith(wanted) ? 1 : 2);
    return [...rows.keys()]
      .filter((id) => id.toLowerCase().includes(wanted))
      .sort((one, other) => rank(one) - rank(other) || byName(one, other))
      .map((id) => [kind, id]);
  }

  #show() {
    this.list.replaceChildren(
      ...this.found.map(([kind, id], index) =>
        make(
          "li",
          { role: "option", id: `found-${index}`, "aria-selected": String(index === this.chosen) },
          id,
          make("small", {}, kind === "uav" ? "UAV" : "task"),
        ),
      ),
    );
    this.list.hidden = !this.found.length;
    setAttribute(this.input, "aria-expanded", String(this.found.length > 0));
    setAttribute(this.input, "aria-activedescendant", this.found.length ? `found-${this.chosen}` : null);
  }

  #key(event) {
    if (event.key === "Escape") {
      event.stopPropagation();
      this.#close();
      this.input.blur();
      return;
    }
    if (!this.found?.length) return;
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) {
      event.preventDefault();
      this.chosen = (this.chosen + step + this.found.length) % this.found.length;
      this.#show();
    } else if (event.key === "Enter") {
      event.preventDefault();
      this.#take(this.chosen);
    }
  }

  #take(index) {
    const [kind, id] = this.found[index];
    this.input.value = "";
    this.#close();
    this.onSelect(kind, id);
  }

  #close() {
    this.found = [];
    this.#show();
  }
}
