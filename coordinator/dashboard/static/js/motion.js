// Where UAVs are drawn between two frames: carried on by their velocity, and eased to what is told.

/** Longer than this after its last word a UAV is drawn where it was [wall s]. */
const LONGEST_S = 1.5;
/** Time in which a difference between drawn and told dwindles to a third [wall s]. */
const EASE_S = 0.15;
const TRAIL_POINTS = 160;

export class Motion {
  constructor() {
    /** Mission seconds per second of wall time. */
    this.rate = 0;
    /** UAV id -> where it is drawn, its heading [rad; clockwise from north] and its trail. */
    this.shown = new Map();
    this.still = window.matchMedia("(prefers-reduced-motion: reduce)");
  }

  /** Takes note of a frame that has just been taken into the picture. */
  hear(picture, changed, wallMs) {
    const { head } = picture;
    const now = head.mission_s;
    if (this.lastMission !== undefined && now !== null && this.lastMission !== null) {
      const past = now - this.lastMission;
      const wall = (wallMs - this.lastWallMs) / 1000;
      if (past < 0 || past > 60 * Math.max(1, this.rate)) this.forgetTrails();
      else if (wall > 0.05) this.rate = this.rate ? 0.7 * this.rate + 0.3 * (past / wall) : past / wall;
    }
    if (head.recording && !head.recording.playing) this.rate = 0;
    this.lastMission = now;
    this.lastWallMs = wallMs;
    if (changed.whole) this.#keepOnly(picture.uavs);
    for (const id of changed.uavs) this.#hearOf(picture.uavs.get(id), wallMs);
  }

  /** Forgets where everybody has been. */
  forgetTrails() {
    for (const each of this.shown.values()) each.trail = [];
  }

  /** Moves everybody to where they are now; whether anything has moved. */
  step(wallMs) {
    const sinceS = Math.min(0.25, (wallMs - (this.steppedMs ?? wallMs)) / 1000);
    this.steppedMs = wallMs;
    const nearer = this.still.matches ? 1 : 1 - Math.exp(-sinceS / EASE_S);
    let moved = false;
    for (const each of this.shown.values()) {
      const aheadS = this.still.matches ? 0 : Math.min(LONGEST_S, (wallMs - each.toldMs) / 1000) * this.rate;
      const east = each.told[0] + each.velocity[0] * aheadS - each.at[0];
      const north = each.told[1] + each.velocity[1] * aheadS - each.at[1];
      if (Math.abs(east) + Math.abs(north) < 0.005) continue;
      each.at[0] += east * nearer;
      each.at[1] += north * nearer;
      moved = true;
    }
    return moved;
  }

  #keepOnly(uavs) {
    for (const id of this.shown.keys()) if (!uavs.has(id)) this.shown.delete(id);
  }

  #hearOf(row, wallMs) {
    if (!row.position) return;
    const [east, north] = row.position;
    const known = this.shown.get(row.id);
    const velocity = row.velocity ?? [0, 0, 0];
    const each = known ?? { at: [east, north], heading: 0, trail: [] };
    each.told = [east, north];
    each.velocity = row.lost ? [0, 0, 0] : velocity;
    each.toldMs = wallMs;
    if (Math.hypot(velocity[0], velocity[1]) > 0.1) each.heading = Math.atan2(velocity[0], velocity[1]);
    const last = each.trail[each.trail.length - 1];
    if (!last || Math.hypot(last[0] - east, last[1] - north) > 0.3) {
      each.trail.push([east, north]);
      if (each.trail.length > TRAIL_POINTS) each.trail.shift();
    }
    this.shown.set(row.id, each);
  }
}
