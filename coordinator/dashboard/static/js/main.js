// The page: takes the feed in, and lets every part show what has changed.

import { Card } from "./card.js";
import { ChoiceLog } from "./choices.js";
import { themeSwitch } from "./colours.js";
import { theToken } from "./dialogs.js";
import { byId, isTyping, setText } from "./dom.js";
import { Feed } from "./feed.js";
import { Finder } from "./finder.js";
import { FleetTable } from "./fleet.js";
import { Header } from "./header.js";
import { showHelp } from "./help.js";
import { Links } from "./links.js";
import { MissionMap } from "./map.js";
import { MapTools } from "./map_tools.js";
import { Motion } from "./motion.js";
import { Operator } from "./operator.js";
import { Order } from "./order.js";
import { Picture } from "./picture.js";
import { Replay } from "./replay.js";
import { Story } from "./story.js";
import { Tabs } from "./tabs.js";
import { TaskTable } from "./tasks.js";
import { timed } from "./timing.js";
import { Worth } from "./worth.js";

const picture = new Picture();
const motion = new Motion();
const feed = new Feed(
  hear,
  (state) => {
    header.connection = state;
  },
  theToken,
);
const header = new Header(picture, feed);
const tabs = new Tabs(() => show(WHOLE));
const map = new MissionMap(byId("map"), picture, motion, {
  select,
  place: (position) => tools.placed(position),
  readout: (text) => tools.readout(text),
});
const operator = new Operator(byId("panel-operator"), picture, (ghosts) => map.expect(ghosts));
const tools = new MapTools(map, picture, operator);
const fleet = new FleetTable(byId("panel-fleet"), picture, select);
const tasks = new TaskTable(byId("panel-tasks"), picture, select);
const choices = new ChoiceLog(byId("panel-choices"), picture, select);
const story = new Story(byId("panel-story"), picture);
const worth = new Worth(byId("panel-worth"), picture);
const order = new Order(byId("panel-order"), picture, select);
const links = new Links(byId("panel-links"), picture, select);
const replay = new Replay(picture, (text) => setText(byId("say-trouble"), text));
const card = new Card(byId("card"), picture, operator, {
  select,
  centre: (position) => position && map.centre(position),
  choices: (of) => {
    tabs.open("choices");
    choices.filter(of);
  },
  close: () => select(null, null),
});
const finder = new Finder(picture, (kind, id) => {
  select(kind, id);
  card.element.focus();
});
// Everything is shown anew, though nothing new was told.
const WHOLE = {
  whole: true,
  again: true,
  mission: true,
  uavs: new Set(),
  tasks: new Set(),
  lists: new Set(),
  zones: new Set(),
  commands: new Set(),
  story: [],
  choices: [],
};

let serverVersion = null;
let missedWhileHidden = false;

function hear(message) {
  const changed = picture.take(message);
  if (!changed) return;
  if (changed.hello) {
    header.newerServer = serverVersion !== null && serverVersion !== message.version;
    serverVersion ??= message.version;
    tabs.offer("operator", operator.able);
  }
  if (message.type === "frame") motion.hear(picture, changed, performance.now());
  if (document.hidden) {
    missedWhileHidden = true;
    return;
  }
  timed("frame", () => show(changed));
}

function show(changed) {
  for (const part of [
    header,
    map,
    tools,
    fleet,
    tasks,
    choices,
    story,
    worth,
    order,
    operator,
    links,
    card,
    replay,
  ]) {
    part.show(changed);
  }
}

/** Chooses a UAV or a task everywhere on the page; null chooses nothing. */
function select(kind, id) {
  const of = kind && (kind === "uav" ? picture.uavs : picture.tasks).has(id) ? { kind, id } : null;
  card.select(of); // first, as it takes room from the lists
  map.select(of?.id ?? null);
  fleet.grid.select(of?.kind === "uav" ? of.id : null, true);
  tasks.grid.select(of?.kind === "task" ? of.id : null, true);
  links.grid.select(of?.kind === "uav" ? of.id : null, true);
  tools.show();
}

const KEYS = {
  "?": showHelp,
  "/": () => finder.focus(),
  f: () => map.fit(),
  l: () => tools.nextLists(),
  h: () => tools.nextLayer(),
  n: () => tools.place(),
  z: () => tools.draw(),
  c: () =>
    card.of &&
    card.on.centre((card.of.kind === "uav" ? picture.uavs : picture.tasks).get(card.of.id)?.position),
};

document.addEventListener("keydown", (event) => {
  if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "Escape") {
    if (!tools.leave()) select(null, null);
  } else if (event.key === "Enter" && map.isPlacing && byId("map").contains(event.target)) {
    event.preventDefault();
    tools.entered(map.middle());
  } else if (event.key === " " && !event.target.closest("a, button, input, select, summary, tr")) {
    event.preventDefault();
    replay.toggle();
  } else if (event.key in KEYS) {
    event.preventDefault();
    KEYS[event.key]();
  } else if (/^[1-8]$/.test(event.key)) {
    const name = tabs.names[Number(event.key) - 1];
    if (name) tabs.open(name);
  }
});

byId("help").addEventListener("click", showHelp);
document.addEventListener("visibilitychange", () => {
  if (!document.hidden && missedWhileHidden) {
    missedWhileHidden = false;
    show(WHOLE);
  }
});
themeSwitch(byId("theme"), () => {
  map.recolour();
  fleet.recolour();
  order.recolour();
  if (card.of) card.select(card.of);
});
tabs.open("fleet");
feed.open();
