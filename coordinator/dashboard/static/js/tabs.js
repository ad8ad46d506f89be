// The lists beside the map. Where there is room, some of them are always there and have no tab.

import { byId, make, setAttribute } from "./dom.js";

const PANELS = [
  ["worth", "Worth"],
  ["order", "Order"],
  ["fleet", "Fleet"],
  ["tasks", "Tasks"],
  ["choices", "Decisions"],
  ["story", "Story"],
  ["operator", "Operator"],
  ["links", "Links"],
];
const ALWAYS_THERE = ["worth", "order", "story"];

export class Tabs {
  /** `onOpen` is called when another tab is shown. */
  constructor(onOpen) {
    this.onOpen = onOpen;
    this.missing = new Set();
    this.wide = window.matchMedia("(min-width: 1000px)");
    this.tabs = new Map(PANELS.map(([name, title], index) => [name, this.#tab(name, title, index)]));
    byId("tabs").append(...this.tabs.values());
    byId("tabs").addEventListener("keydown", (event) => this.#key(event));
    this.wide.addEventListener("change", () => this.open(this.shown));
    this.shown = "fleet";
  }

  /** Names of the tabs there are now. */
  get names() {
    return [...this.tabs.keys()].filter(
      (name) => !this.missing.has(name) && !(this.wide.matches && ALWAYS_THERE.includes(name)),
    );
  }

  /** Whether there is such a tab at all. */
  offer(name, offered) {
    if (offered) this.missing.delete(name);
    else this.missing.add(name);
    this.open(this.shown);
  }

  open(name) {
    this.shown = this.names.includes(name) ? name : "fleet";
    for (const [each, tab] of this.tabs) {
      const chosen = each === this.shown;
      const always = this.wide.matches && ALWAYS_THERE.includes(each);
      tab.hidden = always || this.missing.has(each);
      setAttribute(tab, "aria-selected", String(chosen));
      setAttribute(tab, "tabindex", chosen ? "0" : "-1");
      const panel = byId(`panel-${each}`);
      panel.hidden = !chosen && !always;
      setAttribute(panel, "role", always ? "region" : "tabpanel");
      setAttribute(panel, "aria-labelledby", always ? `head-${each}` : `tab-${each}`);
    }
    this.onOpen();
  }

  #tab(name, title, index) {
    return make(
      "button",
      {
        type: "button",
        role: "tab",
        id: `tab-${name}`,
        "aria-controls": `panel-${name}`,
        "data-index": String(index),
        click: () => this.open(name),
      },
      title,
    );
  }

  #key(event) {
    const names = this.names;
    const at = names.indexOf(this.shown);
    const next = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: names.length - 1 }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    this.open(names[(next + names.length) % names.length]);
    this.tabs.get(this.shown).focus();
  }
}
