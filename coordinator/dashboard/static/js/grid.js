// A table of any length of which only the rows in view exist; rows are chosen by arrow keys or pointer.

import { make, setAttribute, setText } from "./dom.js";

const SPARE_ROWS = 4;

/**
 * A column: `id`, `title`, `value(row)` -> the text that is shown; optionally `draw(cell, row)` for a
 * cell that is more than text, `rank(row)` to sort by it, `hint` for its heading, and `wide` to take
 * what room is left.
 */
export class Grid {
  constructor(
    host,
    { label, columns, rowHeight = 30, onSelect, decorate = () => {}, empty = "Nothing yet." },
  ) {
    Object.assign(this, { columns, rowHeight, onSelect, decorate });
    this.rows = [];
    this.selected = null;
    this.active = 0;
    this.sorted = null;
    this.slots = [];
    this.before = make(
      "tr",
      { class: "spacer", "aria-hidden": "true" },
      make("td", { colspan: columns.length }),
    );
    this.after = make(
      "tr",
      { class: "spacer", "aria-hidden": "true" },
      make("td", { colspan: columns.length }),
    );
    this.body = make("tbody", {}, this.before, this.after);
    this.heads = columns.map((column) => this.#head(column));
    this.table = make(
      "table",
      { role: "grid", "aria-label": label, class: "grid" },
      make("thead", {}, make("tr", { role: "row" }, ...this.heads)),
      this.body,
    );
    this.empty = make("p", { class: "empty" }, empty);
    this.scroller = make("div", { class: "scroller" }, this.table, this.empty);
    this.scroller.addEventListener("scroll", () => this.#render(), { passive: true });
    this.body.addEventListener("click", (event) => this.#click(event));
    this.body.addEventListener("keydown", (event) => this.#key(event));
    this.body.addEventListener("focusin", (event) => this.#focus(event));
    new ResizeObserver(() => this.#render()).observe(this.scroller);
    host.append(this.scroller);
  }

  /** Shows these rows, in this order unless a heading was chosen to sort by. */
  show(rows) {
    this.given = rows;
    this.rows = this.#inOrder(rows);
    setAttribute(this.table, "aria-rowcount", String(rows.length + 1));
    this.empty.hidden = rows.length > 0;
    this.active = Math.min(this.active, Math.max(0, rows.length - 1));
    this.#render();
  }

  /** Marks a row; `reveal` scrolls to it. */
  select(id, reveal = false) {
    this.selected = id;
    const index = this.rows.findIndex((row) => row.id === id);
    if (index >= 0) {
      this.active = index;
      if (reveal) this.#reveal(index);
    }
    this.#render();
  }

  #head(column) {
    const button = column.rank
      ? make("button", { type: "button", class: "sort", click: () => this.#sort(column) }, column.title)
      : column.title;
    return make("th", { scope: "col", class: `col-${column.id}`, title: column.hint ?? null }, button);
  }

  #sort(column) {
    const again = this.sorted?.column === column;
    this.sorted = again && this.sorted.down ? null : { column, down: again };
    this.heads.forEach((head, index) => {
      const by = this.columns[index] === this.sorted?.column;
      setAttribute(head, "aria-sort", by ? (this.sorted.down ? "descending" : "ascending") : null);
    });
    this.show(this.given ?? []);
  }

  #inOrder(rows) {
    if (!this.sorted) return rows;
    const { column, down } = this.sorted;
    const ranked = rows.map((row) => [column.rank(row), row]);
    // What is unknown comes last either way.
    ranked.sort(([one], [other]) => {
      if (one === null || other === null) return (one === null) - (other === null);
      const order = typeof one === "string" ? one.localeCompare(other, "en", { numeric: true }) : one - other;
      return down ? -order : order;
    });
    return ranked.map(([, row]) => row);
  }

  #render() {
    const height = this.scroller.clientHeight;
    if (!height) return;
    const fit = Math.ceil(height / this.rowHeight) + 2 * SPARE_ROWS;
    const most = Math.max(0, this.rows.length - fit);
    const first = Math.min(
      most,
      Math.max(0, Math.floor(this.scroller.scrollTop / this.rowHeight) - SPARE_ROWS),
    );
    const shown = Math.min(fit, this.rows.length);
    const held = this.slots.indexOf(document.activeElement);
    while (this.slots.length < shown) this.slots.push(this.#slot());
    while (this.slots.length > shown) this.slots.pop().remove();
    // Who has scrolled away from the row that has the focus goes on from what is there now.
    if (held >= 0 && (this.active < first || this.active >= first + shown)) {
      this.active = first + Math.min(held, shown - 1);
    }
    this.slots.forEach((slot, index) => this.#fill(slot, first + index));
    this.before.style.height = `${first * this.rowHeight}px`;
    this.after.style.height = `${(this.rows.length - first - shown) * this.rowHeight}px`;
    this.first = first;
    if (held >= 0) this.#slotOf(this.active)?.focus({ preventScroll: true });
  }

  #slot() {
    const slot = make(
      "tr",
      { role: "row" },
      ...this.columns.map((column) => make("td", { class: `col-${column.id}`, role: "gridcell" })),
    );
    this.after.before(slot);
    return slot;
  }

  #fill(slot, index) {
    const row = this.rows[index];
    const chosen = row.id === this.selected;
    if (slot.dataset.id !== String(row.id)) slot.dataset.id = row.id;
    setAttribute(slot, "aria-rowindex", String(index + 2));
    setAttribute(slot, "aria-selected", String(chosen));
    setAttribute(slot, "tabindex", index === this.active ? "0" : "-1");
    this.decorate(slot, row);
    this.columns.forEach((column, number) => {
      const cell = slot.children[number];
      const value = column.value(row);
      if (cell.shownValue === value) return;
      cell.shownValue = value;
      if (column.draw) column.draw(cell, row, value);
      else setText(cell, value);
    });
  }

  #slotOf(index) {
    return this.slots[index - (this.first ?? 0)];
  }

  #reveal(index) {
    const { scrollTop, clientHeight } = this.scroller;
    const top = index * this.rowHeight;
    const room = clientHeight - 2 * this.rowHeight;
    if (top < scrollTop) this.scroller.scrollTop = top;
    else if (top > scrollTop + room) this.scroller.scrollTop = top - room;
  }

  #indexOf(target) {
    const slot = target.closest("tr");
    const place = this.slots.indexOf(slot);
    return place < 0 ? null : (this.first ?? 0) + place;
  }

  #click(event) {
    const index = this.#indexOf(event.target);
    if (index === null) return;
    this.active = index;
    this.onSelect(this.rows[index].id);
  }

  #focus(event) {
    const index = this.#indexOf(event.target);
    if (index !== null && index !== this.active) {
      this.active = index;
      this.#render();
    }
  }

  #key(event) {
    const page = Math.max(1, Math.floor(this.scroller.clientHeight / this.rowHeight) - 2);
    const steps = {
      ArrowDown: 1,
      ArrowUp: -1,
      PageDown: page,
      PageUp: -page,
      Home: -Infinity,
      End: Infinity,
    };
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      this.onSelect(this.rows[this.active].id);
    } else if (event.key in steps) {
      event.preventDefault();
      this.active = Math.min(this.rows.length - 1, Math.max(0, this.active + steps[event.key]));
      this.#reveal(this.active);
      this.#render();
      this.#slotOf(this.active)?.focus({ preventScroll: true });
    }
  }
}
