// Who can be heard, who is lost, and which messages were dropped why.

import { make, setAttribute, setText } from "./dom.js";
import { Grid } from "./grid.js";
import { isTroubled } from "./fleet.js";
import { timing } from "./timing.js";
import { NOTHING, byName, number, seconds } from "./words.js";

export class Links {
  constructor(panel, picture, onSelect) {
    this.panel = panel;
    this.picture = picture;
    this.values = {};
    const row = (key, title) => {
      this.values[key] = make("dd", {}, NOTHING);
      return make("div", {}, make("dt", {}, title), this.values[key]);
    };
    this.reasons = make("table", { class: "bars" });
    panel.append(
      make(
        "dl",
        { class: "facts" },
        row("bus", "Bus"),
        row("coordinator", "Coordinator"),
        row("others", "Others there"),
        row("lost", "Lost UAVs"),
        row("here", "Dropped here"),
        row("page", "This page"),
      ),
      this.reasons,
    );
    this.grid = new Grid(panel, {
      label: "Links",
      empty: "No UAV is known yet.",
      onSelect: (id) => onSelect("uav", id),
      decorate: (slot, uav) =>
        setAttribute(slot, "data-trouble", isTroubled(uav) || !uav.present ? "" : null),
      columns: [
        { id: "uav", title: "UAV", value: (uav) => uav.id, rank: (uav) => uav.id },
        { id: "link", title: "Link", value: link, rank: link },
        {
          id: "heard",
          title: "Heard",
          value: (uav) => (uav.silent_s === null ? "never" : seconds(uav.silent_s)),
          rank: (uav) => uav.silent_s,
        },
        {
          id: "dropped",
          title: "Dropped",
          value: (uav) => String(total(uav.dropped)),
          rank: (uav) => total(uav.dropped),
        },
        { id: "note", title: "Reasons", value: (uav) => reasons(uav.dropped) },
      ],
    });
  }

  show() {
    if (this.panel.hidden) return;
    const { head, uavs, hello } = this.picture;
    if (!head) return;
    const rows = [...uavs.values()].sort(
      (one, other) =>
        isTroubled(other) - isTroubled(one) ||
        total(other.dropped) - total(one.dropped) ||
        byName(one.id, other.id),
    );
    this.grid.show(rows);
    const lost = rows.filter((row) => row.lost).map((row) => row.id);
    setText(this.values.bus, head.link ? "joined" : "no link: nothing new can be heard");
    setText(this.values.coordinator, head.coordinator ? "there" : "not there; the fleet flies on by itself");
    setText(this.values.others, head.others?.length ? head.others.join(", ") : "nobody");
    setText(this.values.lost, lost.length ? lost.join(", ") : "none");
    setText(this.values.here, reasons(head.dropped_here) || "nothing");
    const [frame, ground, moving] = ["frame", "ground", "moving"].map(timing);
    const ms = (time) => (time ? `${number(time.median)} ms (${number(time.longest)})` : NOTHING);
    setText(
      this.values.page,
      `frame ${ms(frame)}, ground ${ms(ground)}, UAVs ${ms(moving)} · server ${hello?.version ?? NOTHING}`,
    );
    this.#reasons(head.dropped ?? {});
  }

  #reasons(dropped) {
    const sorted = Object.entries(dropped).sort((one, other) => other[1] - one[1]);
    const known = JSON.stringify(sorted);
    if (known === this.known) return;
    this.known = known;
    const most = sorted[0]?.[1] ?? 1;
    const rows = sorted.map(([reason, many]) => {
      const bar = make("i", { "aria-hidden": "true" });
      bar.style.width = `${(100 * many) / most}%`;
      return make(
        "tr",
        {},
        make("th", { scope: "row" }, reason),
        make("td", { class: "bar" }, bar),
        make("td", {}, number(many, 0)),
      );
    });
    this.reasons.replaceChildren(
      make("caption", {}, rows.length ? "Dropped messages by reason" : "No message has been dropped"),
      ...rows,
    );
  }
}

function link(uav) {
  if (uav.lost) return "lost";
  return uav.present ? "up" : "not there";
}

function total(dropped) {
  return Object.values(dropped ?? {}).reduce((sum, many) => sum + many, 0);
}

/** Dropped messages of one UAV in words. */
export function reasons(dropped) {
  return Object.entries(dropped ?? {})
    .map(([reason, many]) => `${many} ${reason}`)
    .join(", ");
}
