// Drawing the mission on two canvases: what changes with frames below, what moves above.

import { uavColour } from "./colours.js";
import { paintConflicts, paintNearest } from "./encounters.js";
import { layerOf } from "./layers.js";
import { arrow, bars, cross, disc, label, line, path, ring, tick } from "./strokes.js";
import { taskState } from "./words.js";

const WIDE = 2 * Math.PI;
/** How visible a UAV is that flies in another layer than the one that is shown. */
const FAINT = 0.18;
/** Radius of the first point of a line [px]. */
const LINE_END = 3.5;
/** From so many tasks on lines have no names, but for the one that is selected. */
const MOST_NAMED_LINES = 40;
/** Pixels per letter of all names from which on tasks are named. */
const ROOM_PER_LETTER = 330;

/** The plane of one drawing: turns unit coordinates into pixels of the canvas. */
export class View {
  constructor(projection, scale, left, top, width, height) {
    Object.assign(this, { projection, scale, left, top, width, height });
  }

  /** Pixels of a place in metres. */
  spot(position) {
    const [u, v] = this.projection.unit(position);
    return [u * this.scale - this.left, v * this.scale - this.top];
  }

  /** Whether a spot is on the canvas, or nearly. */
  holds([x, y], margin = 30) {
    return x > -margin && y > -margin && x < this.width + margin && y < this.height + margin;
  }
}

/** Radius of a task by its value [px]; of a line, which is drawn itself, its first point is small. */
export function taskRadius(task, look) {
  const radius = look.size * (0.55 + 0.75 * Math.sqrt(Math.max(0, task.value) / look.mostValue));
  return task.path?.length ? Math.min(LINE_END, radius) : radius;
}

/** Everything below the UAVs: grid, lists, trails, tasks. Fills `spots` with where tasks are. */
export function paintGround(canvas, view, picture, motion, look, spots) {
  canvas.clearRect(0, 0, view.width, view.height);
  if (look.grid) paintGrid(canvas, view, look);
  for (const area of picture.mission?.areas ?? []) paintArea(canvas, view, area, look);
  for (const zone of picture.zonesInForce) paintZone(canvas, view, zone, look);
  paintLines(canvas, view, picture, look);
  paintLists(canvas, view, picture, motion, look);
  paintTrails(canvas, view, picture, motion, look);
  for (const base of picture.mission?.bases ?? []) paintBase(canvas, view, base, look);
  paintTasks(canvas, view, picture, look, spots);
  paintOutline(canvas, view, look);
}

/** An area to be covered: shaded, with its border and its holes. */
function paintArea(canvas, view, { id, rings }, look) {
  const { ink } = look;
  canvas.beginPath();
  for (const ring of rings) trace(canvas, view, ring);
  canvas.fillStyle = canvas.strokeStyle = ink.accent;
  canvas.lineWidth = 1;
  canvas.globalAlpha = 0.08;
  canvas.fill("evenodd");
  canvas.globalAlpha = 0.7;
  canvas.stroke();
  canvas.globalAlpha = 1;
  canvas.font = `italic 11px ${ink.font}`;
  canvas.textAlign = "center";
  const spots = rings[0].map((corner) => view.spot(corner));
  const top = spots.reduce((best, spot) => (spot[1] < best[1] ? spot : best));
  label(canvas, id, top[0], top[1] - 5, ink.accent, look);
}

/** A zone: hatched inside where nobody may fly; of one to keep inside, only the border. */
function paintZone(canvas, view, zone, look) {
  const { ink } = look;
  canvas.save();
  canvas.beginPath();
  for (const ring of [zone.polygon, ...zone.holes]) trace(canvas, view, ring);
  canvas.strokeStyle = ink.trouble;
  canvas.lineWidth = 1.5;
  canvas.setLineDash(zone.inclusive ? [10, 5] : []);
  canvas.stroke();
  if (!zone.inclusive) {
    canvas.clip("evenodd");
    hatch(canvas, zone.polygon.map((corner) => view.spot(corner)), view);
  }
  canvas.restore();
  canvas.font = `italic 11px ${ink.font}`;
  canvas.textAlign = "center";
  const spots = zone.polygon.map((corner) => view.spot(corner));
  const [x, y] = [0, 1].map((axis) => spots.reduce((sum, spot) => sum + spot[axis], 0) / spots.length);
  label(canvas, zone.id, x, y + 4, ink.trouble, look);
}

/** One more closed ring of what is to be filled or drawn. */
function trace(canvas, view, corners) {
  corners.forEach((corner, index) => canvas[index ? "lineTo" : "moveTo"](...view.spot(corner)));
  canvas.closePath();
}

/** Slanting lines over what of those spots is in view; whoever calls has clipped. */
function hatch(canvas, spots, view) {
  const [xs, ys] = [spots.map(([x]) => x), spots.map(([, y]) => y)];
  const [left, right] = [Math.max(-20, Math.min(...xs)), Math.min(view.width + 20, Math.max(...xs))];
  const [top, bottom] = [Math.max(-20, Math.min(...ys)), Math.min(view.height + 20, Math.max(...ys))];
  canvas.globalAlpha = 0.4;
  canvas.lineWidth = 1;
  canvas.setLineDash([]);
  canvas.beginPath();
  const first = Math.floor((left + top) / 9) * 9;
  for (let sum = first; sum < right + bottom; sum += 9) {
    canvas.moveTo(sum - top, top);
    canvas.lineTo(sum - bottom, bottom);
  }
  canvas.stroke();
  canvas.globalAlpha = 1;
}

/** Tasks that are lines, those that were flown in the colour of who has. */
function paintLines(canvas, view, picture, look) {
  for (const task of picture.tasks.values()) {
    if (!task.path?.length || task.state === "withdrawn") continue;
    const flown = task.state === "done" && task.uav;
    const { ink } = look;
    canvas.strokeStyle = flown ? uavColour(picture.described(task.uav).number, ink.dark) : ink.muted;
    canvas.lineWidth = flown ? 4 : 2;
    path(canvas, view, task.path);
  }
}

function paintBase(canvas, view, base, look) {
  const spot = view.spot(base.position);
  if (!view.holds(spot)) return;
  const [x, y] = spot;
  canvas.fillStyle = look.ink.ground;
  canvas.strokeStyle = look.ink.text;
  canvas.lineWidth = 2;
  canvas.fillRect(x - 9, y - 9, 18, 18);
  canvas.strokeRect(x - 9, y - 9, 18, 18);
  canvas.font = `11px ${look.ink.font}`;
  canvas.textAlign = "center";
  label(canvas, base.id, x, y + 22, look.ink.text, look);
}

/** The zone that is being drawn, as far as it is. */
function paintOutline(canvas, view, look) {
  if (!look.corners.length) return;
  const { accent } = look.ink;
  canvas.strokeStyle = accent;
  canvas.fillStyle = accent;
  canvas.lineWidth = 2;
  canvas.setLineDash([5, 4]);
  path(canvas, view, [...look.corners, look.corners[0]]);
  canvas.setLineDash([]);
  for (const corner of look.corners) {
    const [x, y] = view.spot(corner);
    canvas.fillRect(x - 4, y - 4, 8, 8);
  }
}

/** A round distance of at least `metres`. */
export function roundDistance(metres) {
  const power = 10 ** Math.floor(Math.log10(metres));
  return power * [1, 2, 5, 10].find((step) => step * power >= metres);
}

function paintGrid(canvas, view, look) {
  const step = roundDistance(90 / view.scale);
  const { ink } = look;
  canvas.strokeStyle = ink.faint;
  canvas.fillStyle = ink.muted;
  canvas.lineWidth = 1;
  canvas.font = `10px ${ink.font}`;
  canvas.textAlign = "left";
  const [west, north] = [view.left / view.scale, -view.top / view.scale];
  const decimals = step < 1 ? 1 : 0;
  for (let east = Math.ceil(west / step) * step; ; east += step) {
    const x = Math.round(east * view.scale - view.left) + 0.5;
    if (x > view.width) break;
    line(canvas, x, 0, x, view.height);
    canvas.fillText(`${(east || 0).toFixed(decimals)} m`, x + 3, 11);
  }
  for (let up = Math.floor(north / step) * step; ; up -= step) {
    const y = Math.round(-up * view.scale - view.top) + 0.5;
    if (y > view.height) break;
    line(canvas, 0, y, view.width, y);
    if (y > 22 && y < view.height - 34) canvas.fillText(`${(up || 0).toFixed(decimals)} m`, 3, y - 3);
  }
}

function paintLists(canvas, view, picture, motion, look) {
  for (const [id, { planned, flown, ways }] of picture.lists) {
    if (!look.showsList(id)) continue;
    const strong = look.selected === id;
    const described = picture.described(id);
    canvas.strokeStyle = uavColour(described.number, look.ink.dark);
    const visited = flown.map((task) => picture.tasks.get(task)?.position).filter(Boolean);
    canvas.globalAlpha = strong ? 0.9 : 0.5;
    canvas.lineWidth = strong ? 2.5 : 1.5;
    if (ways) paintFlown(canvas, view, ways, motion.shown.get(id)?.told);
    else if (visited.length && described.start) path(canvas, view, [described.start, ...visited]);
    const uav = picture.uavs.get(id);
    if (uav?.lost || (uav?.claim === "out" && !ways)) continue;
    if (ways) {
      canvas.globalAlpha = strong ? 0.95 : 0.6;
      canvas.lineWidth = strong ? 1.75 : 1;
      canvas.setLineDash(strong ? [6, 5] : [3, 5]);
      path(canvas, view, ways.ahead);
      canvas.setLineDash([]);
      continue;
    }
    const ahead = planned
      .map((task) => picture.tasks.get(task))
      .filter((task) => task && task.state === "open" && task.id !== uav?.task);
    if (!ahead.length) continue;
    const from = picture.tasks.get(uav?.task)?.position ?? motion.shown.get(id)?.told ?? described.start;
    canvas.globalAlpha = strong ? 0.95 : 0.6;
    canvas.lineWidth = strong ? 1.75 : 1;
    canvas.setLineDash(strong ? [6, 5] : [3, 5]);
    path(canvas, view, [...(from ? [from] : []), ...ahead.map((task) => task.position)]);
    canvas.setLineDash([]);
  }
  canvas.globalAlpha = 1;
}

/** The ways flown in the field, and of the one that is being flown what lies behind `place`. */
function paintFlown(canvas, view, { flown, leg }, place) {
  path(canvas, view, flown);
  if (place && leg.length) path(canvas, view, [...leg.slice(0, 1 + lastPassed(leg, place)), place]);
}

/** Index of the corner of a way behind which `place` lies: of the nearest piece, its beginning. */
export function lastPassed(way, place) {
  let [best, found] = [Infinity, 0];
  for (let index = 0; index + 1 < way.length; index += 1) {
    const [[east, north], [toEast, toNorth]] = [way[index], way[index + 1]];
    const along = [toEast - east, toNorth - north];
    const beyond = [place[0] - east, place[1] - north];
    const square = along[0] ** 2 + along[1] ** 2;
    const share = square ? (along[0] * beyond[0] + along[1] * beyond[1]) / square : 0;
    const held = Math.min(1, Math.max(0, share));
    const away = Math.hypot(beyond[0] - held * along[0], beyond[1] - held * along[1]);
    if (away < best) [best, found] = [away, index];
  }
  return found;
}

function paintTrails(canvas, view, picture, motion, look) {
  canvas.lineCap = "round";
  for (const [id, { trail }] of motion.shown) {
    if (trail.length < 2) continue;
    canvas.strokeStyle = uavColour(picture.described(id).number, look.ink.dark);
    canvas.lineWidth = look.selected === id ? 4 : 3;
    // The older the fainter, in three parts.
    const third = Math.ceil(trail.length / 3);
    for (let part = 0; part < 3; part += 1) {
      canvas.globalAlpha = [0.07, 0.16, 0.3][part];
      path(canvas, view, trail.slice(part * third, (part + 1) * third + 1));
    }
  }
  canvas.globalAlpha = 1;
}

function paintTasks(canvas, view, picture, look, spots) {
  spots.clear();
  const inView = [];
  for (const task of picture.tasks.values()) {
    const spot = view.spot(task.position);
    if (!view.holds(spot)) continue;
    spots.set(task.id, spot);
    inView.push([task, spot]);
  }
  // What is over lies below what is still to do.
  const weight = (task) => (task.state === "open" ? 2 : task.state === "failed" ? 1 : 0);
  inView.sort((one, other) => weight(one[0]) - weight(other[0]));
  for (const [task, spot] of inView) paintTask(canvas, task, spot, picture, look);
  const named = inView.filter(
    ([task]) => !task.path?.length || picture.tasks.size < MOST_NAMED_LINES || look.selected === task.id,
  );
  const letters = named.reduce((sum, [task]) => sum + task.id.length, 0);
  if (view.width * view.height < letters * ROOM_PER_LETTER) return;
  canvas.font = `11px ${look.ink.font}`;
  canvas.textAlign = "center";
  const labels = named.map(([task, [x, y]]) => ({
    text: task.id,
    weight: weight(task) + (look.selected === task.id ? 10 : 0),
    x,
    y: y + taskRadius(task, look) + 12,
    colour: task.state === "open" ? look.ink.text : look.ink.muted,
  }));
  paintLabels(canvas, labels, look, 10);
}

/** One task: hollow when open, dashed when left out, with a core when taken, full when done, crossed when failed. */
function paintTask(canvas, task, [x, y], picture, look) {
  const { ink } = look;
  const state = taskState(task);
  const colour = task.uav ? uavColour(picture.described(task.uav).number, ink.dark) : ink.text;
  let radius = taskRadius(task, look);
  canvas.lineWidth = radius > 5 ? 2 : 1.5;
  canvas.fillStyle = ink.ground;
  canvas.strokeStyle = colour;
  if (state === "open") {
    canvas.strokeStyle = ink.text;
    disc(canvas, x, y, radius);
  } else if (state === "left_out") {
    canvas.strokeStyle = ink.text;
    canvas.setLineDash([2, 3]);
    disc(canvas, x, y, radius);
    canvas.setLineDash([]);
  } else if (state === "taken") {
    canvas.lineWidth += 0.5;
    disc(canvas, x, y, radius + 1);
    canvas.fillStyle = colour;
    canvas.beginPath();
    canvas.arc(x, y, radius * 0.45, 0, WIDE);
    canvas.fill();
  } else if (state === "done") {
    radius *= 0.85;
    canvas.globalAlpha = 0.75;
    canvas.fillStyle = colour;
    canvas.beginPath();
    canvas.arc(x, y, radius, 0, WIDE);
    canvas.fill();
    canvas.globalAlpha = 1;
    if (radius >= 5) tick(canvas, x, y, radius, ink.ground);
  } else if (state === "failed") {
    canvas.strokeStyle = ink.trouble;
    canvas.lineWidth = 2.5;
    cross(canvas, x, y, Math.max(4, radius * 0.7));
  } else {
    canvas.strokeStyle = ink.muted;
    canvas.lineWidth = 1.25;
    canvas.beginPath();
    canvas.arc(x, y, radius * 0.75, 0, WIDE);
    canvas.moveTo(x - radius, y + radius);
    canvas.lineTo(x + radius, y - radius);
    canvas.stroke();
  }
  if (task.by === "operator") paintByOperator(canvas, x, y, radius, ink);
  if (look.selected === task.id) ring(canvas, x, y, radius + 6, ink.accent);
}

/** Corners around a task that the operator added. */
function paintByOperator(canvas, x, y, radius, ink) {
  const half = radius + 3.5;
  canvas.strokeStyle = ink.muted;
  canvas.lineWidth = 1.25;
  canvas.beginPath();
  for (const [across, down] of [
    [-1, -1],
    [1, -1],
    [1, 1],
    [-1, 1],
  ]) {
    canvas.moveTo(x + across * half, y + down * (half - 3.5));
    canvas.lineTo(x + across * half, y + down * half);
    canvas.lineTo(x + across * (half - 3.5), y + down * half);
  }
  canvas.stroke();
}

/** Everything that moves: target lines, UAVs and their labels. Fills `spots` with where UAVs are. */
export function paintUavs(canvas, view, picture, motion, look, spots) {
  canvas.clearRect(0, 0, view.width, view.height);
  spots.clear();
  canvas.font = `600 11px ${look.ink.font}`;
  canvas.textAlign = "left";
  const layers = picture.mission?.layers_m ?? [];
  const meeting = new Set((picture.head?.conflicts ?? []).flatMap(({ uavs }) => uavs));
  const inLayer = (row) =>
    look.layer === null || layerOf(row, layers) === look.layer || meeting.has(row.id);
  for (const [id, { at }] of motion.shown) {
    const row = picture.uavs.get(id);
    const spot = view.spot(at);
    if (!row || !view.holds(spot, 400)) continue;
    spots.set(id, spot);
    canvas.strokeStyle = uavColour(picture.described(id).number, look.ink.dark);
    canvas.lineWidth = look.selected === id ? 2 : 1.25;
    canvas.globalAlpha = inLayer(row) ? 1 : FAINT;
    const leg = picture.lists.get(id)?.ways?.leg;
    if (leg?.length && !row.lost) path(canvas, view, [at, ...leg.slice(1 + lastPassed(leg, at))]);
    const target = row.task && !row.lost && !leg ? picture.tasks.get(row.task) : null;
    if (!target) continue;
    const [x, y] = view.spot(target.position);
    line(canvas, spot[0], spot[1], x, y);
  }
  canvas.globalAlpha = 1;
  paintNearest(canvas, view, picture, motion, look);
  const labels = [];
  for (const [id, spot] of spots) {
    if (!view.holds(spot)) continue;
    const row = picture.uavs.get(id);
    const shown = inLayer(row);
    canvas.globalAlpha = shown ? 1 : FAINT;
    const name = paintUav(canvas, picture, motion.shown.get(id), row, spot, look);
    if (shown || name.weight > 0) labels.push(name);
  }
  canvas.globalAlpha = 1;
  paintLabels(canvas, labels, look, 1);
  paintConflicts(canvas, view, picture, motion, look);
  for (const ghost of look.ghosts) paintGhost(canvas, view.spot(ghost.position), ghost.label, look);
}

function paintUav(canvas, picture, motion, row, [x, y], look) {
  const { ink } = look;
  const described = picture.described(row.id);
  const colour = uavColour(described.number, ink.dark);
  const troubled = row.lost || row.does === "out" || row.does === "absent";
  const size = look.uavSize;
  canvas.save();
  canvas.translate(x, y);
  if (troubled) {
    canvas.strokeStyle = ink.trouble;
    canvas.fillStyle = ink.ground;
    canvas.lineWidth = 2;
    arrow(canvas, size, Math.PI);
    canvas.fill();
    canvas.stroke();
    cross(canvas, 0, 0, size * 0.35);
  } else {
    canvas.fillStyle = colour;
    canvas.strokeStyle = ink.ground;
    canvas.lineWidth = 1.5;
    arrow(canvas, size, motion.heading);
    canvas.fill();
    canvas.stroke();
    if (row.does === "holding") bars(canvas, size, ink);
  }
  if (look.selected === row.id) ring(canvas, 0, 0, size + 6, ink.accent);
  canvas.restore();
  const chosen = look.selected === row.id;
  return {
    text: chosen ? told(row, picture) : described.short + high(row),
    weight: chosen ? 2 : Number(troubled),
    x: x + size + 3,
    y: y + 4,
    colour: troubled ? ink.trouble : ink.text,
  };
}

/** Labels that have room, the weightiest first; those of weight `always` or more in any case. */
function paintLabels(canvas, labels, look, always) {
  const taken = [];
  const centred = canvas.textAlign === "center" ? 0.5 : 0;
  for (const each of labels.sort((one, other) => other.weight - one.weight)) {
    const width = canvas.measureText(each.text).width;
    const [left, right] = [each.x - centred * width, each.x + (1 - centred) * width];
    const hits = ([from, to, y]) => left < to && right > from && Math.abs(each.y - y) < 12;
    if (each.weight < always && taken.some(hits)) continue;
    taken.push([left, right, each.y]);
    label(canvas, each.text, each.x, each.y, each.colour, look);
  }
}

/** At which height it flies, beside its name. */
function high(row) {
  return row.height_m === null || row.height_m < 1 ? "" : ` ${row.height_m.toFixed(0)} m`;
}

/** Id, target and rule of the UAV that is selected. */
function told(row, picture) {
  const goal = row.task ?? row.base;
  const target = goal ? ` → ${goal}` : ` ${row.does}`;
  return `${row.id}${high(row)}${target}${picture.head.rule ? ` · ${picture.head.rule}` : ""}`;
}

function paintGhost(canvas, [x, y], text, look) {
  canvas.strokeStyle = look.ink.accent;
  canvas.lineWidth = 2;
  canvas.setLineDash([3, 3]);
  canvas.beginPath();
  canvas.arc(x, y, 9, 0, WIDE);
  canvas.stroke();
  canvas.setLineDash([]);
  label(canvas, text, x + 13, y + 4, look.ink.accent, look);
}
