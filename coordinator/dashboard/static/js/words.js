// Numbers, states and signs as people read them. States differ in sign and word, never in colour alone.

export const NOTHING = "–";

/** What a UAV does: its sign, and whether that is trouble, activity or rest. */
export const DOES = {
  "to base": ["▲", "busy"],
  waiting: ["△", "held"],
  swapping: ["▣", "busy"],
  "at base": ["□", "rest"],
  parked: ["□", "rest"],
  starting: ["◌", "rest"],
  learning: ["◌", "rest"],
  preparing: ["◌", "rest"],
  idle: ["○", "rest"],
  flying: ["▲", "busy"],
  serving: ["◆", "busy"],
  holding: ["‖", "held"],
  returning: ["◁", "held"],
  home: ["⌂", "rest"],
  out: ["⊘", "trouble"],
  lost: ["▽", "trouble"],
  absent: ["▽", "trouble"],
};

/** Task states in the order of a mission; "taken" is open with a UAV on its way, "left_out" by the plan. */
export const TASK_STATES = ["open", "left_out", "taken", "done", "failed", "withdrawn"];
export const TASK_SIGNS = {
  open: "○",
  left_out: "◌",
  taken: "◎",
  done: "●",
  failed: "×",
  withdrawn: "⊘",
};
export const COMMAND_SIGNS = { pending: "◌", obeyed: "✓", "not obeyed": "×" };

/** State of a task as the page shows it. */
export function taskState(task) {
  if (task.state !== "open") return task.state;
  if (task.taken) return "taken";
  return task.left_out ? "left_out" : "open";
}

/** A state as people read it, of a task with the reason why it is left out. */
export function stateWord(state, task = null) {
  return state.replace("_", " ") + (task?.left_out ? ` (${task.left_out})` : "");
}

/** A number with at most that many digits behind the point, thousands apart. */
export function number(value, digits = 1) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  const size = Math.abs(value);
  if (size >= 1e7) return value.toExponential(3).replace("e+", "e");
  const shown = value.toFixed(size >= 1000 ? 0 : digits);
  const [whole, part] = shown.split(".");
  const apart = whole.replace(/(\d)(?=(\d{3})+$)/g, "$1\u202f");
  return part === undefined || /^0*$/.test(part) ? apart : `${apart}.${part}`;
}

/** Seconds, from 100 on as minutes and seconds. */
export function seconds(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  if (Math.abs(value) < 99.95) return `${value.toFixed(1)} s`;
  const sign = value < 0 ? "−" : "";
  const whole = Math.floor(Math.abs(value) + 0.05);
  const pad = (part) => String(part).padStart(2, "0");
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return sign + (hours ? `${hours}:${pad(minutes)}:${pad(rest)}` : `${minutes}:${pad(rest)}`);
}

/** Metres between two UAVs: the nearer the more digits. */
export function metres(value) {
  return value === null || value === undefined ? NOTHING : `${number(value, value < 10 ? 2 : 1)} m`;
}

/** A share of 1 in percent. */
export function percent(fraction, digits = 0) {
  if (fraction === null || fraction === undefined || !Number.isFinite(fraction)) return NOTHING;
  return `${(100 * fraction).toFixed(digits)} %`;
}

/** East, north (and up) in metres. */
export function place(position) {
  if (!position) return NOTHING;
  const [east, north, up] = position.map((metres) => number(metres, 1));
  return `E ${east}  N ${north}${position[2] ? `  U ${up}` : ""} m`;
}

/** Degrees as chart makers write them. */
export function degrees([lat, lon]) {
  const side = (value, plus, minus) => `${Math.abs(value).toFixed(6)}° ${value < 0 ? minus : plus}`;
  return `${side(lat, "N", "S")}, ${side(lon, "E", "W")}`;
}

/** "3 tasks", "1 task". */
export function count(many, what) {
  return `${many} ${what}${many === 1 ? "" : "s"}`;
}

/** Ids in the order people count: uav2 before uav10. */
export const byName = new Intl.Collator("en", { numeric: true }).compare;
