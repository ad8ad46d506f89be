// How long the page itself takes, so that anyone can see whether it keeps up.

const KEPT = 120;
const kept = new Map();

/** Runs `work` and keeps how long that took under `name`. */
export function timed(name, work) {
  const began = performance.now();
  work();
  const times = kept.get(name) ?? [];
  times.push(performance.now() - began);
  if (times.length > KEPT) times.shift();
  kept.set(name, times);
}

/** Median and longest of the newest times under `name` [ms]; null before the first. */
export function timing(name) {
  const times = [...(kept.get(name) ?? [])].sort((one, other) => one - other);
  if (!times.length) return null;
  return { median: times[times.length >> 1], longest: times[times.length - 1] };
}
