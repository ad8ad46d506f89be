// What the operator says: questions, what was sent, and what came of it as the feed tells it.

import { ask, field, postWithToken, reasonField } from "./dialogs.js";
import { byId, make, setText } from "./dom.js";
import { degreesOf } from "./frames.js";
import { COMMAND_SIGNS, degrees, number } from "./words.js";

const VERDICT_MS = 7000;

const COMMANDS = {
  start: {
    title: (uav) => `Start without ${uav}?`,
    text: "The others begin as soon as all of them are airborne. It joins in when it is ready after all.",
    confirm: "Start without it",
  },
  hold: {
    title: (uav) => `Hold ${uav}?`,
    text: "It stops where it is, gives its task up and waits. On the ground it stays there.",
    confirm: "Hold",
  },
  resume: { title: (uav) => `Let ${uav} go on?`, text: "It takes tasks again.", confirm: "Resume" },
  ready: {
    title: (uav) => `May ${uav} start again?`,
    text: "Its battery has been changed and nobody stands near: it arms and takes off by itself.",
    confirm: "It is ready",
  },
  return: {
    title: (uav) => `Send ${uav} home?`,
    text: "It gives its task up, flies home and takes no further part in this mission.",
    confirm: "Return",
  },
};

export class Operator {
  /** `onExpect(ghosts)` gets the tasks that were asked for and are not on the board yet. */
  constructor(panel, picture, onExpect) {
    Object.assign(this, { picture, onExpect });
    /** Commands of this page that are on their way: number -> {toast, ghost}. */
    this.sent = new Map();
    this.list = make("ol", { class: "log commands", "aria-label": "Commands, newest first" });
    this.empty = make("p", { class: "empty" }, "No command has been given from here.");
    this.buttons = make("div", { class: "filters", role: "group", "aria-label": "Zones" });
    this.zonesShown = "";
    panel.append(this.buttons, make("div", { class: "scroller" }, this.list, this.empty));
    byId("abort").addEventListener("click", () => this.abort());
  }

  /** Whether this server takes commands now. */
  get able() {
    return Boolean(this.picture.hello?.commands && this.picture.hello.kind === "live");
  }

  show(changed) {
    this.#zones();
    if (changed.hello) this.renewed = true;
    if (changed.whole && this.renewed && !changed.again) {
      this.renewed = false;
      this.#forgetFormer();
    }
    if (!changed.whole && !changed.commands.size) return;
    const rows = [...this.picture.commands.values()].sort((one, other) => other.n - one.n);
    this.empty.hidden = rows.length > 0;
    this.list.replaceChildren(...rows.map(commandLine));
    for (const row of rows) this.#follow(row);
  }

  /** Asks whether to command a UAV, and does. */
  command(kind, uav) {
    const { title, text, confirm } = COMMANDS[kind];
    return this.#ask({
      title: title(uav),
      text,
      confirm,
      danger: kind === "return" || kind === "ready",
      fields: [field("Reason (optional)", reasonField())],
      send: (form) =>
        this.#post(
          "api/command",
          { command: kind, uav, reason: form.get("reason").trim() },
          kind === "start" ? `start without ${uav}` : `${kind} ${uav}`,
        ),
    });
  }

  /** Asks twice, since it ends the mission. */
  abort() {
    if (!this.able) return null;
    const sure = make("input", { type: "checkbox", name: "sure", required: true });
    return this.#ask({
      title: "Abort the mission?",
      text: "Every UAV gives its task up and flies home. The mission is over and cannot be taken up again.",
      confirm: "Abort mission",
      danger: true,
      fields: [
        field("Reason (optional)", reasonField()),
        make("label", { class: "check" }, sure, "Yes, bring all UAVs home now"),
      ],
      send: (form) =>
        this.#post(
          "api/command",
          { command: "abort", uav: null, reason: form.get("reason").trim() },
          "abort",
        ),
    });
  }

  /** Asks what task is wanted at a place, and adds it. */
  addTask(position) {
    const input = (name, value, more = {}) =>
      make("input", { name, type: "number", step: "any", value: String(value), required: true, ...more });
    const { origin } = this.picture.mission ?? {};
    return this.#ask({
      title: "New task",
      text: "The next UAV that decides may take it.",
      confirm: "Add task",
      fields: [
        make(
          "div",
          { class: "row" },
          field("East [m]", input("east", position[0].toFixed(1))),
          field("North [m]", input("north", position[1].toFixed(1))),
          field("Up [m]", input("up", (position[2] ?? 0).toFixed(1))),
        ),
        origin ? make("p", { class: "fine" }, degrees(degreesOf(origin, position))) : null,
        make(
          "div",
          { class: "row" },
          field("Value", input("value", number(this.#usualValue()).replace("\u202f", ""), { min: "0" })),
          field("Service [s]", input("service", 0, { min: "0" })),
        ),
        make(
          "div",
          { class: "row" },
          field(
            "Id",
            make("input", {
              name: "id",
              maxlength: "64",
              pattern: "[A-Za-z0-9][A-Za-z0-9_.\\-]*",
              placeholder: "next free",
              autocomplete: "off",
            }),
          ),
          field("Kind", this.#kindField()),
        ),
        field("Reason (optional)", reasonField()),
      ],
      send: (form) => {
        const at = ["east", "north", "up"].map((name) => Number(form.get(name)));
        const id = form.get("id").trim() || null;
        const body = {
          id,
          position: at,
          value: Number(form.get("value")),
          service_s: Number(form.get("service")),
          kind: form.get("kind").trim() || null,
          reason: form.get("reason").trim(),
        };
        return this.#post("api/task", body, `add ${id ?? "a task"}`, {
          position: at,
          label: `${id ?? "task"} …`,
        });
      },
    });
  }

  /** Asks what zone is wanted round those corners, and draws it. */
  addZone(corners) {
    let free = 1;
    while (this.picture.zones.has(`zone-${free}`)) free += 1;
    const height = (name) =>
      make("input", { name, type: "number", step: "any", placeholder: "no limit" });
    return this.#ask({
      title: "New zone",
      text: "Nobody may fly there from now on: who is in it leaves by the shortest way, tasks in it are out of reach.",
      confirm: "Draw zone",
      danger: true,
      fields: [
        field(
          "Id",
          make("input", {
            name: "id",
            required: true,
            maxlength: "64",
            pattern: "[A-Za-z0-9][A-Za-z0-9_.\\-]*",
            value: `zone-${free}`,
            autocomplete: "off",
          }),
        ),
        make("p", { class: "fine" }, `${corners.length} corners`),
        make(
          "div",
          { class: "row" },
          field("From height [m]", height("floor")),
          field("To height [m]", height("ceiling")),
        ),
        make(
          "label",
          { class: "check" },
          make("input", { type: "checkbox", name: "inclusive" }),
          "The only place where to fly: keep inside",
        ),
        field("Reason (optional)", reasonField()),
      ],
      send: (form) => {
        const limit = (name) => (form.get(name) === "" ? null : Number(form.get(name)));
        const body = {
          id: form.get("id").trim(),
          polygon: corners.map(([east, north]) => [east, north]),
          floor_m: limit("floor"),
          ceiling_m: limit("ceiling"),
          inclusive: form.get("inclusive") !== null,
          reason: form.get("reason").trim(),
        };
        return this.#post("api/zone", body, `draw zone ${body.id}`);
      },
    });
  }

  removeZone(zone) {
    return this.#ask({
      title: `Take zone ${zone} away?`,
      text: "The fleet may fly there again.",
      confirm: "Take away",
      danger: true,
      fields: [field("Reason (optional)", reasonField())],
      send: (form) =>
        this.#post(
          "api/zone/remove",
          { id: zone, reason: form.get("reason").trim() },
          `take zone ${zone} away`,
        ),
    });
  }

  /** A button for each zone that holds. */
  #zones() {
    const names = this.able ? this.picture.zonesInForce.map((zone) => zone.id) : [];
    if (names.join(" ") === this.zonesShown) return;
    this.zonesShown = names.join(" ");
    this.buttons.replaceChildren(
      ...names.map((name) =>
        make(
          "button",
          { type: "button", class: "pill", title: "Take it away", click: () => this.removeZone(name) },
          `Zone ${name} ×`,
        ),
      ),
    );
  }

  withdraw(task) {
    return this.#ask({
      title: `Withdraw ${task}?`,
      text: "It leaves the board. A UAV on its way to it turns to something else.",
      confirm: "Withdraw",
      danger: true,
      fields: [field("Reason (optional)", reasonField())],
      send: (form) =>
        this.#post("api/task/withdraw", { id: task, reason: form.get("reason").trim() }, `withdraw ${task}`),
    });
  }

  #ask(question) {
    return this.able ? ask(question) : null;
  }

  #usualValue() {
    const values = [...this.picture.tasks.values()]
      .map((task) => task.value)
      .sort((one, other) => one - other);
    return values[values.length >> 1] ?? 1;
  }

  #kindField() {
    const kinds = new Set([...this.picture.tasks.values()].map((task) => task.kind).filter(Boolean));
    const list = make(
      "datalist",
      { id: "kinds" },
      ...[...kinds].sort().map((kind) => make("option", { value: kind })),
    );
    return make(
      "span",
      {},
      make("input", {
        name: "kind",
        maxlength: "64",
        list: "kinds",
        placeholder: "any",
        autocomplete: "off",
      }),
      list,
    );
  }

  async #post(path, body, text, ghost = null) {
    const n = await postWithToken(path, body);
    this.sent.set(n, { toast: toast(text), ghost });
    this.expect();
    const row = this.picture.commands.get(n);
    if (row) this.#follow(row);
    return n;
  }

  /** Shows what the feed tells of a command of ours. */
  #follow(row) {
    const ours = this.sent.get(row.n);
    if (!ours) return;
    ours.toast.show(row);
    if (row.state === "pending") return;
    this.sent.delete(row.n);
    this.expect();
    setText(
      byId(row.state === "obeyed" ? "say-polite" : "say-trouble"),
      `${row.text}: ${row.result || row.state}`,
    );
  }

  /** Shows on the map what was asked for and has not come, and what is being asked for. */
  expect(...asked) {
    this.onExpect([...asked, ...[...this.sent.values()].map((each) => each.ghost).filter(Boolean)]);
  }

  /** Commands of a server that has begun anew can't be followed any more. */
  #forgetFormer() {
    for (const [n, ours] of this.sent) {
      if (this.picture.commands.has(n)) continue;
      ours.toast.show({
        text: ours.toast.text,
        state: "not obeyed",
        result: "the dashboard began anew; look at the fleet for what came of it",
      });
      this.sent.delete(n);
    }
    this.expect();
  }
}

function commandLine(row) {
  return make(
    "li",
    { class: row.state === "not obeyed" ? "trouble" : null, "data-state": row.state },
    make("i", { "aria-hidden": "true" }, COMMAND_SIGNS[row.state] ?? "·"),
    make(
      "span",
      {},
      make("b", {}, row.text),
      ` ${row.state}`,
      row.result ? make("small", {}, row.result) : null,
    ),
  );
}

/** A note that stays until its command has been obeyed or not, and a while longer. */
function toast(text) {
  const sign = make("i", { "aria-hidden": "true" });
  const words = make("span", {});
  const close = make(
    "button",
    { type: "button", class: "quiet", "aria-label": "Close", click: () => element.remove() },
    "×",
  );
  const element = make("div", { class: "toast" }, sign, words, close);
  const show = (row) => {
    element.dataset.state = row.state;
    setText(sign, COMMAND_SIGNS[row.state] ?? "·");
    setText(
      words,
      row.state === "pending"
        ? `${row.text}: sent, waiting for what comes of it`
        : `${row.text}: ${row.result || row.state}`,
    );
    if (row.state !== "pending") setTimeout(() => element.remove(), VERDICT_MS);
  };
  show({ text, state: "pending" });
  byId("toasts").append(element);
  return { text, show };
}
