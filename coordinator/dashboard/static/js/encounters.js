// Who is near to whom on the map, who has been, and who is about to come too near.

import { cross, label, line, ring } from "./strokes.js";
import { metres } from "./words.js";

/** The two UAVs that are nearest to each other now, and where two have been nearest so far. */
export function paintNearest(canvas, view, picture, motion, look) {
  const { now, so_far: soFar } = picture.head?.nearest ?? {};
  const { ink } = look;
  if (soFar) {
    const [[x, y], [otherX, otherY]] = soFar.places.map((position) => view.spot(position));
    canvas.strokeStyle = ink.muted;
    canvas.lineWidth = 1.5;
    cross(canvas, (x + otherX) / 2, (y + otherY) / 2, 4);
    const text = `least ${metres(soFar.distance_m)}`;
    label(canvas, text, (x + otherX) / 2 + 8, (y + otherY) / 2 - 6, ink.muted, look);
  }
  if (!now) return;
  const [one, other] = now.uavs.map((id) => motion.shown.get(id)?.at);
  if (!one || !other) return;
  const [[x, y], [otherX, otherY]] = [one, other].map((position) => view.spot(position));
  canvas.strokeStyle = ink.text;
  canvas.lineWidth = 1.5;
  canvas.setLineDash([2, 3]);
  line(canvas, x, y, otherX, otherY);
  canvas.setLineDash([]);
  label(canvas, metres(now.distance_m), (x + otherX) / 2 + 8, (y + otherY) / 2 + 16, ink.text, look);
}

/** Who would come too near to whom: the ways to where they would meet, and how near, and when. */
export function paintConflicts(canvas, view, picture, motion, look) {
  const { trouble } = look.ink;
  for (const { uavs, places, distance_m: distance, in_s: soon } of picture.head?.conflicts ?? []) {
    const spots = places.map((position) => view.spot(position));
    canvas.strokeStyle = trouble;
    canvas.lineWidth = 2;
    canvas.setLineDash([5, 4]);
    uavs.forEach((id, index) => {
      const at = motion.shown.get(id)?.at;
      if (at) line(canvas, ...view.spot(at), ...spots[index]);
    });
    canvas.setLineDash([]);
    const [[x, y], [otherX, otherY]] = spots;
    const [midX, midY] = [(x + otherX) / 2, (y + otherY) / 2];
    const radius = Math.max(7, Math.hypot(x - otherX, y - otherY) / 2 + 3);
    ring(canvas, midX, midY, radius, trouble);
    const text = `${metres(distance)} in ${Math.round(soon)} s`;
    label(canvas, text, midX + radius + 4, midY - 4, trouble, look);
  }
}
