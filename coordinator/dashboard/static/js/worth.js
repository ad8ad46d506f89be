// What the mission is worth so far: the curve of J against the plan's J and what no plan can exceed.

import { draw, make, setText } from "./dom.js";
import { NOTHING, number, percent, seconds } from "./words.js";

const [WIDTH, HEIGHT] = [320, 110];
const EDGE = { left: 2, right: 2, top: 8, bottom: 14 };

export class Worth {
  constructor(panel, picture) {
    this.picture = picture;
    this.area = draw("path", { class: "area" });
    this.curve = draw("path", { class: "curve" });
    this.plan = draw("path", { class: "plan" });
    this.bound = draw("path", { class: "bound" });
    this.base = draw("path", { class: "base" });
    this.till = draw("text", { class: "axis", x: WIDTH - EDGE.right, y: HEIGHT - 2, "text-anchor": "end" });
    this.chart = draw(
      "svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img" },
      this.base,
      this.area,
      this.bound,
      this.plan,
      this.curve,
    );
    this.axis = make("p", { class: "axis" }, make("span", {}, "0"), make("span", {}));
    this.values = {};
    this.why = make("figcaption", { class: "fine", hidden: "" });
    const row = (key, sign, title, hint) => {
      this.values[key] = make("dd", {});
      return make(
        "div",
        { class: key, title: hint },
        make("dt", {}, make("i", { "aria-hidden": "true" }, sign), title),
        this.values[key],
      );
    };
    panel.append(
      make(
        "header",
        {},
        make("h2", { id: "head-worth" }, "Worth J"),
        make("span", { class: "fine" }, "value · s"),
      ),
      make(
        "div",
        { class: "worth" },
        make("figure", {}, this.chart, this.axis, this.why),
        make(
          "dl",
          {},
          row("now", "━", "so far", "J of all tasks done so far"),
          row("share", " ", "of plan", "J so far over the plan's J"),
          row("plan", "╌", "plan", "J of the plan, if all goes as planned"),
          row("bound", "─", "bound", "No plan can be worth more"),
        ),
      ),
    );
  }

  show() {
    const { head, curve } = this.picture;
    if (!head) return;
    const { objective, plan, mission_s: now } = head;
    setText(this.values.now, number(objective));
    setText(this.values.share, plan?.objective ? percent(objective / plan.objective, 1) : NOTHING);
    const why = whyUnknown(head);
    setText(this.values.plan, why ? "unknown" : number(plan?.objective));
    setText(this.values.bound, why ? "unknown" : number(plan?.bound));
    setText(this.why, why);
    this.why.hidden = !why;
    this.#draw(objective, plan, now, curve);
  }

  #draw(objective, plan, now, curve) {
    const last = curve.length ? curve[curve.length - 1][0] : 0;
    const till = Math.max(now ?? 0, last, 1e-3);
    const values = [objective, plan?.objective, plan?.bound, ...curve.map((point) => point[1])].filter(
      Number.isFinite,
    );
    const [most, least] = [Math.max(1e-9, ...values) * 1.04, Math.min(0, ...values)];
    const x = (time) =>
      (EDGE.left + (Math.max(0, time) / till) * (WIDTH - EDGE.left - EDGE.right)).toFixed(1);
    const y = (worth) =>
      (HEIGHT - 2 - ((worth - least) / (most - least)) * (HEIGHT - 2 - EDGE.top)).toFixed(1);
    // J rises by steps: what a task is worth counts from the moment it is done.
    let steps = `M${x(0)} ${y(0)}`;
    for (const [time, worth] of curve) steps += `H${x(time)}V${y(worth)}`;
    steps += `H${x(till)}`;
    const across = (worth) => (Number.isFinite(worth) ? `M0 ${y(worth)}H${WIDTH}` : "");
    this.curve.setAttribute("d", steps);
    this.area.setAttribute("d", `${steps}V${y(0)}H${x(0)}Z`);
    this.plan.setAttribute("d", across(plan?.objective));
    this.bound.setAttribute("d", across(plan?.bound));
    this.base.setAttribute("d", across(0));
    setText(this.axis.lastChild, seconds(till));
    this.chart.setAttribute(
      "aria-label",
      `J so far ${number(objective)}, the plan's ${number(plan?.objective)}, bound ${number(plan?.bound)}`,
    );
  }
}

/** Why nothing is known of a plan; empty where it is, or there is none yet. */
function whyUnknown({ plan, epoch, phase }) {
  if (Number.isFinite(plan?.objective) || !Number.isFinite(epoch)) return "";
  if (epoch > 1 || phase === "ended")
    return "The plan is that of the first epoch, which was over before anything was seen here.";
  return phase === "running" ? "The first epoch has no lists." : "";
}
