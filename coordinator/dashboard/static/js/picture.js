// All that the feed has told, kept up to date message by message. Knows nothing of the page.

import { byName } from "./words.js";

const STORY_LINES = 500;
const CHOICES = 300;
const CURVE_POINTS = 600;

/** What a message has changed; a frame that is whole has changed everything. */
function changes(whole = false) {
  return {
    whole,
    again: false,
    hello: false,
    mission: false,
    uavs: new Set(),
    tasks: new Set(),
    lists: new Set(),
    zones: new Set(),
    commands: new Set(),
    story: [],
    choices: [],
  };
}

export class Picture {
  constructor() {
    this.hello = null;
    /** The newest `mission` message; null before the first. */
    this.mission = null;
    /** First block of the newest frame; null before the first. */
    this.head = null;
    this.forget();
  }

  /** Drops everything that belongs to one mission. */
  forget() {
    this.uavs = new Map();
    this.tasks = new Map();
    this.lists = new Map();
    this.zones = new Map();
    this.commands = new Map();
    this.story = [];
    this.choices = [];
    this.curve = [];
    this.inOrder = null;
  }

  /** All tasks in the order people count. */
  get tasksInOrder() {
    // Rows never vanish from a mission: as many as before are the same ones.
    if (this.inOrder?.length !== this.tasks.size) this.inOrder = [...this.tasks.keys()].sort(byName);
    return this.inOrder.map((id) => this.tasks.get(id));
  }

  /** Takes a message of the feed in; what has changed, or null for one that is not understood. */
  take(message) {
    switch (message.type) {
      case "hello":
        this.hello = message;
        return { ...changes(), hello: true };
      case "mission":
        return this.#takeMission(message);
      case "frame":
        return this.#takeFrame(message);
      default:
        return null;
    }
  }

  /** Zones that hold, in the order people count. */
  get zonesInForce() {
    return [...this.zones.values()]
      .filter((zone) => !zone.withdrawn)
      .sort((one, other) => byName(one.id, other.id));
  }

  /** What the fleet's description says of a UAV. */
  described(id) {
    return this.byId?.get(id) ?? { id, short: id, number: 0, start: null, speed_m_s: null, kind: null };
  }

  #takeMission(message) {
    if (this.mission && this.mission.name !== message.name) {
      this.forget();
      this.head = null;
    }
    this.mission = message;
    this.byId = new Map(message.uavs.map((uav, number) => [uav.id, { ...uav, number }]));
    return { ...changes(), mission: true };
  }

  #takeFrame(frame) {
    const changed = changes(frame.whole);
    if (frame.whole) this.forget();
    const { uavs, tasks, lists, zones, commands, story, choices, objective_curve: curve, ...head } = frame;
    this.head = head;
    changed.uavs = merge(this.uavs, uavs, "id");
    changed.tasks = merge(this.tasks, tasks, "id");
    changed.lists = merge(this.lists, lists, "uav");
    changed.zones = merge(this.zones, zones, "id");
    changed.commands = merge(this.commands, commands, "n");
    changed.story = grow(this.story, story, STORY_LINES);
    changed.choices = grow(this.choices, choices, CHOICES);
    this.curve.push(...(curve ?? []));
    if (this.curve.length > 2 * CURVE_POINTS) this.curve = thinned(this.curve);
    return changed;
  }
}

/** Takes in rows, of which only the fields that have changed are told; the keys of those. */
function merge(known, rows, key) {
  const changed = new Set();
  for (const row of rows ?? []) {
    known.set(row[key], { ...known.get(row[key]), ...row });
    changed.add(row[key]);
  }
  return changed;
}

/** Appends what is new by its number `n`; keeps the newest. */
function grow(known, told, most) {
  const last = known.length ? known[known.length - 1].n : -1;
  const fresh = (told ?? []).filter((line) => line.n > last);
  known.push(...fresh);
  if (known.length > most) known.splice(0, known.length - most);
  return fresh;
}

/** Every second point, and the last. */
function thinned(curve) {
  return curve.filter((_, index) => index % 2 === 0 || index === curve.length - 1);
}
