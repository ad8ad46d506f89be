// Keys and signs, explained in a dialog.

import { make } from "./dom.js";
import { DOES, TASK_SIGNS, stateWord } from "./words.js";

export const KEYS = [
  ["?", "this page"],
  ["/", "find a UAV or a task"],
  ["Tab", "go from one control to the next"],
  ["↑ ↓ Page Home End", "go along the rows of a list; Enter chooses one"],
  ["← →", "go along the tabs"],
  ["1 … 8", "open a tab"],
  ["f", "show the whole mission on the map"],
  ["l", "lists on the map: all, of the chosen UAV, none"],
  ["h", "height layers on the map: all, or one after the other"],
  ["n", "new task: click its place, or move the map and press Enter"],
  ["z", "new zone: click its corners; Enter when all are there"],
  ["c", "bring what is chosen to the middle"],
  ["Space", "play or pause a recording"],
  ["Esc", "leave what was begun, close the card"],
];

const WORDS = {
  open: "waiting",
  left_out: "waiting, and the plan leaves it out",
  taken: "a UAV is on its way or at it",
  done: "done",
  failed: "failed",
  withdrawn: "taken off the board",
};

export function showHelp() {
  const keys = make(
    "dl",
    { class: "keys" },
    ...KEYS.map(([key, what]) => make("div", {}, make("dt", {}, make("kbd", {}, key)), make("dd", {}, what))),
  );
  const tasks = make(
    "ul",
    { class: "signs" },
    ...Object.entries(TASK_SIGNS).map(([state, sign]) =>
      make(
        "li",
        {},
        make("span", { class: `state task-${state}` }, make("i", {}, sign), stateWord(state)),
        WORDS[state],
      ),
    ),
  );
  const does = make(
    "ul",
    { class: "signs" },
    ...Object.entries(DOES).map(([what, [sign, mood]]) =>
      make("li", {}, make("span", { class: `state ${mood}` }, make("i", {}, sign), what)),
    ),
  );
  const dialog = make(
    "dialog",
    { class: "help", "aria-labelledby": "help-title" },
    make(
      "form",
      { method: "dialog" },
      make("h2", { id: "help-title" }, "Keys and signs"),
      keys,
      make("h3", {}, "Tasks"),
      tasks,
      make(
        "p",
        { class: "fine" },
        "The larger a task, the greater its value; corners mark those that the operator added.",
      ),
      make("h3", {}, "UAVs"),
      does,
      make(
        "p",
        { class: "fine" },
        "Solid lines were flown, dashed ones are planned; the straight line from a UAV leads to its task. Shaded areas are to be covered by lines, which are broad once they are flown. Hatched ones are zones where nobody may fly; squares are bases where batteries are changed.",
      ),
      make("menu", {}, make("button", { class: "primary", autofocus: true }, "Close")),
    ),
  );
  dialog.addEventListener("close", () => dialog.remove());
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  document.body.append(dialog);
  dialog.showModal();
}
