// The pecking order in force: sequence, epoch, rule, and why it was made.

import { uavColour } from "./colours.js";
import { make, setText } from "./dom.js";
import { isTroubled } from "./fleet.js";

export class Order {
  constructor(panel, picture, onSelect) {
    Object.assign(this, { picture, onSelect });
    this.epoch = make("span", { class: "fine" });
    this.reason = make("p", { class: "reason" });
    this.list = make("ol", { class: "order", "aria-label": "Sequence, first rank first" });
    panel.append(
      make("header", {}, make("h2", { id: "head-order" }, "Pecking order"), this.epoch),
      this.reason,
      this.list,
    );
    this.known = "";
  }

  show(changed) {
    const { head } = this.picture;
    if (!head) return;
    setText(this.epoch, head.epoch === null ? "" : `epoch ${head.epoch} · ${head.rule ?? "no rule"}`);
    setText(this.reason, head.reason ?? "");
    const sequence = head.sequence ?? [];
    const known = sequence.join(" ");
    if (known !== this.known || changed.whole || changed.mission) {
      this.known = known;
      this.list.replaceChildren(...sequence.map((id) => this.#chip(id)));
    }
    for (const item of this.list.children) {
      const row = this.picture.uavs.get(item.firstChild.dataset.id);
      item.classList.toggle("trouble", Boolean(row && isTroubled(row)));
    }
  }

  recolour() {
    this.known = "";
    this.show({});
  }

  #chip(id) {
    const { short, number } = this.picture.described(id);
    const dot = make("i", { class: "dot", "aria-hidden": "true" });
    dot.style.background = uavColour(number);
    const button = make(
      "button",
      { type: "button", "data-id": id, "aria-label": id, title: id, click: () => this.onSelect("uav", id) },
      dot,
      short,
    );
    return make("li", {}, button);
  }
}
