// The decision log: each choice in one line, unfolding to what it was chosen from and why.

import { make, setText } from "./dom.js";
import { number, seconds } from "./words.js";

const SHOWN = 200;
/** Scores nearer to each other than this share of the best are drawn from a later beginning. */
const CLOSE_FRAC = 0.3;

export class ChoiceLog {
  /** `panel` gets the log; `onSelect(kind, id)` follows names. */
  constructor(panel, picture, onSelect) {
    Object.assign(this, { picture, onSelect });
    this.of = null;
    this.caption = make("p", { class: "caption" });
    this.all = make(
      "button",
      { type: "button", class: "pill", hidden: true, click: () => this.filter(null) },
      "Show all",
    );
    this.list = make("ol", { class: "log choices", "aria-label": "Decisions, newest first" });
    this.empty = make("p", { class: "empty" }, "No UAV has chosen a task yet.");
    panel.append(
      make("div", { class: "filters" }, this.caption, this.all),
      make("div", { class: "scroller" }, this.list, this.empty),
    );
    this.filter(null);
  }

  /** Shows only choices of a UAV or about a task: `{kind, id}`, or all. */
  filter(of) {
    this.of = of;
    this.all.hidden = of === null;
    this.#rebuild();
  }

  show(changed) {
    if (changed.whole) {
      this.#rebuild();
      return;
    }
    const fresh = changed.choices.filter((choice) => concerns(choice, this.of));
    if (!fresh.length) return;
    this.list.prepend(...fresh.reverse().map((choice) => this.#line(choice)));
    while (this.list.children.length > SHOWN) this.list.lastChild.remove();
    this.#caption();
  }

  #rebuild() {
    const shown = this.picture.choices
      .filter((choice) => concerns(choice, this.of))
      .slice(-SHOWN)
      .reverse();
    const open = new Set([...this.list.querySelectorAll("details[open]")].map((each) => each.dataset.n));
    this.list.replaceChildren(...shown.map((choice) => this.#line(choice, open.has(String(choice.n)))));
    this.#caption();
  }

  #caption() {
    const { of } = this;
    this.empty.hidden = this.list.children.length > 0;
    setText(
      this.caption,
      of === null ? "Who chose what, and why" : `Choices ${of.kind === "uav" ? "of" : "about"} ${of.id}`,
    );
  }

  #line(choice, open = false) {
    return make("li", {}, choiceDetails(choice, this.onSelect, open));
  }
}

/** Whether a choice belongs to that UAV, or took, left or considered that task. */
export function concerns(choice, of) {
  if (of === null) return true;
  if (of.kind === "uav") return choice.uav === of.id;
  return choice.task === of.id || choice.left === of.id;
}

/** One choice: its line, and all about it once it is unfolded. */
export function choiceDetails(choice, onSelect, open = false) {
  const details = make(
    "details",
    { "data-n": String(choice.n) },
    make(
      "summary",
      {},
      make("time", {}, seconds(choice.mission_s)),
      make("b", {}, choice.uav),
      " → ",
      make("b", {}, choice.task ?? `base ${choice.base}`),
      choice.left ? make("span", { class: "tag" }, `left ${choice.left}`) : null,
      choice.base ? null : make("span", { class: "lead" }, lead(choice)),
      choice.certificate
        ? make("span", { class: "tag good", title: "Theorem 5 proves it" }, "✓ proven")
        : null,
    ),
  );
  const unfold = () => details.children.length > 1 || details.append(body(choice, onSelect));
  details.addEventListener("toggle", unfold);
  if (open) {
    unfold();
    details.open = true;
  }
  return details;
}

/** By how much it beat the second best. */
function lead({ score, second_score: second }) {
  if (second === null) return "nothing else to take";
  const by = score - second;
  const share = Math.abs(second) > 1e-9 ? ` (${((100 * by) / Math.abs(second)).toFixed(1)} %)` : "";
  return `+${number(by, 2)}${share}`.replace("+-", "−");
}

function body(choice, onSelect) {
  const go = (kind, id) =>
    make("button", { type: "button", class: "link", click: () => onSelect(kind, id) }, id);
  const decision = make("p", { class: "fine" }, `Decision ${choice.id}`);
  const by = `by the rule ${choice.rule}, rank ${choice.rank + 1} of epoch ${choice.epoch}`;
  if (choice.base)
    return make(
      "div",
      { class: "unfolded" },
      make("p", {}, go("uav", choice.uav), ` flew to base ${choice.base} ${by}: ${choice.why}.`),
      make("p", {}, `It expected to be ready there at ${seconds(choice.completion_s)}.`),
      decision,
    );
  const told = [
    make(
      "p",
      {},
      go("uav", choice.uav),
      ` took `,
      go("task", choice.task),
      ` ${by}; it expected to be done at ${seconds(choice.completion_s)}.`,
    ),
  ];
  if (choice.left)
    told.push(
      make(
        "p",
        {},
        "It turned aside from ",
        go("task", choice.left),
        " in flight: the whole team gains by it.",
      ),
    );
  told.push(
    make(
      "p",
      {},
      choice.second_score === null
        ? "There was no other task to take."
        : `Score ${number(choice.score, 2)}, second best ${number(choice.second_score, 2)}.`,
    ),
  );
  told.push(
    make(
      "p",
      {},
      choice.certificate
        ? "Certificate: by Theorem 5 the greedy choice is also the best beginning of this UAV's whole tour."
        : "No certificate: Theorem 5 does not settle this choice; its score does.",
    ),
  );
  const { candidates } = choice;
  return make(
    "div",
    { class: "unfolded" },
    ...told,
    candidates.length ? bars(choice, go) : null,
    decision,
  );
}

/** Candidates as bars; where all are close the bars begin later, and say so. */
function bars({ candidates, task }, go) {
  const scores = candidates.map((each) => each.score);
  const [best, worst] = [Math.max(...scores), Math.min(...scores)];
  const close = best > 0 && worst > 0 && best - worst < CLOSE_FRAC * best && best > worst;
  const begin = close ? Math.max(0, worst - 0.35 * (best - worst)) : Math.min(0, worst);
  const width = (score) => (best > begin ? (100 * (score - begin)) / (best - begin) : 100);
  const rows = candidates.map((each) => {
    const bar = make("i", { "aria-hidden": "true" });
    bar.style.width = `${width(each.score).toFixed(1)}%`;
    return make(
      "tr",
      { class: each.task === task ? "taken" : null },
      make("th", { scope: "row" }, go("task", each.task)),
      make("td", { class: "bar" }, bar),
      make("td", {}, number(each.score, 2)),
      make("td", {}, each.score === best ? "best" : `−${number(best - each.score, 2)}`),
    );
  });
  return make(
    "table",
    { class: "bars" },
    make("caption", {}, `Candidates and scores${close ? `; bars begin at ${number(begin, 1)}` : ""}`),
    ...rows,
  );
}
