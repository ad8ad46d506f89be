// The story of the mission, newest first; trouble is marked, and said aloud.

import { byId, make, setText } from "./dom.js";
import { count, seconds } from "./words.js";

const SHOWN = 300;

export class Story {
  constructor(panel, picture) {
    this.picture = picture;
    this.troubleOnly = make("input", { type: "checkbox", change: () => this.#rebuild() });
    this.list = make("ol", {
      class: "log story",
      "aria-label": "What happened, newest first",
      tabindex: "0",
    });
    panel.append(
      make(
        "header",
        {},
        make("h2", { id: "head-story" }, "Story"),
        make("label", { class: "check" }, this.troubleOnly, "Trouble only"),
      ),
      this.list,
    );
  }

  show(changed) {
    if (changed.whole) {
      this.#rebuild();
      return;
    }
    if (!changed.story.length) return;
    this.list.prepend(...this.#wanted(changed.story).reverse().map(line));
    while (this.list.children.length > SHOWN) this.list.lastChild.remove();
    const troubles = changed.story.filter((told) => told.trouble);
    if (troubles.length > 3)
      setText(byId("say-trouble"), `${count(troubles.length, "trouble")}, the last: ${troubles.at(-1).text}`);
    else if (troubles.length) setText(byId("say-trouble"), troubles.map((told) => told.text).join("; "));
  }

  #wanted(lines) {
    return this.troubleOnly.checked ? lines.filter((told) => told.trouble) : [...lines];
  }

  #rebuild() {
    this.list.replaceChildren(...this.#wanted(this.picture.story).slice(-SHOWN).reverse().map(line));
  }
}

function line(told) {
  return make(
    "li",
    { class: told.trouble ? "trouble" : null },
    make("time", {}, told.mission_s === null ? "start-up" : seconds(told.mission_s)),
    told.trouble ? make("i", { role: "img", "aria-label": "trouble:" }, "!") : null,
    make("span", {}, told.text),
  );
}
