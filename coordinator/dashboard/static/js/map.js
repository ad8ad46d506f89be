// The map: Leaflet moves and zooms it, everything on it is painted on two canvases of our own.

import { inks } from "./colours.js";
import { make, setText } from "./dom.js";
import { PLANE, earth } from "./frames.js";
import { View, paintGround, paintUavs, taskRadius } from "./paint.js";
import { timed } from "./timing.js";
import { number, place, stateWord, taskState } from "./words.js";

/** Least time between two pictures of what moves [ms]: 30 a second are smooth enough. */
const BETWEEN_MS = 30;

export class MissionMap {
  /**
   * @param container element of the map.
   * @param picture what the feed has told.
   * @param motion where UAVs are drawn.
   * @param on `{select(kind, id), place(position), readout(text)}`.
   */
  constructor(container, picture, motion, on) {
    Object.assign(this, { container, picture, motion, on });
    this.projection = PLANE;
    this.map = window.L.map(container, {
      crs: PLANE.crs(),
      center: [0, 0],
      zoom: 0,
      minZoom: -8,
      maxZoom: 9,
      zoomSnap: 0.25,
      zoomDelta: 0.5,
      zoomControl: false,
      attributionControl: false,
      zoomAnimation: false,
      fadeAnimation: false,
      inertia: !motion.still.matches,
      wheelPxPerZoomLevel: 90,
      boxZoom: false,
      doubleClickZoom: false,
    });
    this.scale = window.L.control.scale({ imperial: false, maxWidth: 120 }).addTo(this.map);
    this.credit = window.L.control.attribution({ prefix: false, position: "bottomright" });
    this.ground = this.#canvas("ground");
    this.moving = this.#canvas("moving");
    this.taskSpots = new Map();
    this.uavSpots = new Map();
    this.ghosts = [];
    this.corners = [];
    this.selected = null;
    this.lists = null;
    /** Index of the height layer that is shown alone; null: all are. */
    this.layer = null;
    this.fitted = null;
    this.hint = container.appendChild(make("div", { class: "hint", hidden: true, "aria-hidden": "true" }));
    this.map.on("move zoom resize viewreset", () => this.#moved());
    this.map.on("click", (event) => this.#click(event));
    this.map.on("mousemove", (event) => this.#hover(event));
    this.map.on("mouseout", () => this.#hover(null));
    new ResizeObserver(() => this.map.invalidateSize({ animate: false, pan: true })).observe(container);
    this.recolour();
    this.lastMs = 0;
    requestAnimationFrame((wallMs) => this.#run(wallMs));
  }

  /** Takes note of a frame. */
  show(changed) {
    if (
      this.picture.mission &&
      this.picture.head &&
      this.fitted !== this.picture.mission.name &&
      this.#places().length
    )
      this.fit();
    this.mostValue = Math.max(1e-9, ...[...this.picture.tasks.values()].map((task) => task.value));
    this.groundDirty = true;
    this.movingDirty = true;
    if (changed.whole) this.#measure();
  }

  recolour() {
    this.ink = inks();
    this.groundDirty = this.movingDirty = true;
  }

  select(id) {
    this.selected = id;
    this.groundDirty = this.movingDirty = true;
  }

  /** Which lists are drawn: "all", "selected" or "none". */
  get listsShown() {
    return this.lists ?? (this.picture.uavs.size > 12 ? "selected" : "all");
  }

  showLists(which) {
    this.lists = which;
    this.groundDirty = true;
  }

  /** Shows the UAVs of one height layer, by its index, and the others faintly; null shows all. */
  showLayer(index) {
    this.layer = index;
    this.movingDirty = true;
  }

  /** Tasks that were asked for and that the feed does not show yet. */
  expect(ghosts) {
    this.ghosts = ghosts;
    this.movingDirty = true;
  }

  /** Corners of the zone that is being drawn. */
  outline(corners) {
    this.corners = corners;
    this.groundDirty = true;
  }

  /** Whether there is a map of the earth to switch to. */
  get hasEarth() {
    return Boolean(this.picture.hello?.tiles && this.picture.mission?.origin);
  }

  /** Shows the mission's plane in metres, or the earth with its tiles. */
  project(onEarth) {
    const { hello, mission } = this.picture;
    const projection = onEarth && this.hasEarth ? earth(mission.origin) : PLANE;
    if (projection.name === this.projection.name) return;
    this.projection = projection;
    this.tiles?.remove();
    this.credit.remove();
    this.map.options.crs = projection.crs();
    this.map.setMinZoom(projection.zooms[0]).setMaxZoom(projection.zooms[1]);
    this.fit();
    if (projection === PLANE) return;
    this.tiles = window.L.tileLayer(hello.tiles, { maxZoom: projection.zooms[1], maxNativeZoom: 19 });
    this.tiles.addTo(this.map);
    if (hello.tiles_credit) this.credit.addTo(this.map).addAttribution(escaped(hello.tiles_credit));
  }

  /** Shows everything. */
  fit() {
    const places = this.#places();
    if (!places.length) return;
    const bounds = window.L.latLngBounds(places.map((position) => this.projection.toLeaflet(position)));
    this.map.invalidateSize({ animate: false });
    this.map.fitBounds(bounds, {
      paddingTopLeft: [40, 56],
      paddingBottomRight: [40, this.picture.hello?.kind === "replay" ? 100 : 40],
      maxZoom: this.projection === PLANE ? 6 : 20,
      animate: false,
    });
    this.fitted = this.picture.mission?.name ?? null;
    this.#measure();
  }

  zoom(steps) {
    this.map.zoomIn(steps, { animate: false });
  }

  /** Brings a place to the middle. */
  centre(position) {
    this.map.panTo(this.projection.toLeaflet(position), { animate: !this.motion.still.matches });
  }

  /** East, north, up of the middle of the map. */
  middle() {
    return [...this.projection.fromLeaflet(this.map.getCenter()), 0];
  }

  /** Lets the next click say a place. */
  set placing(placing) {
    this.isPlacing = placing;
    this.container.classList.toggle("placing-mode", placing);
  }

  #places() {
    const { uavs = [], bases = [] } = this.picture.mission ?? {};
    const starts = [...uavs.map((uav) => uav.start).filter(Boolean), ...bases.map((base) => base.position)];
    return [...starts, ...[...this.picture.tasks.values()].map((task) => task.position)];
  }

  #canvas(name) {
    const canvas = make("canvas", { class: `paint ${name}`, "aria-hidden": "true" });
    this.container.append(canvas);
    return canvas;
  }

  #moved() {
    this.groundDirty = this.movingDirty = true;
    this.#paint();
  }

  /** Sizes of signs follow how much there is to show on how much room. */
  #measure() {
    const size = this.map.getSize();
    const room = (size.x * size.y) / Math.max(8, this.picture.tasks.size);
    this.taskSize = Math.min(10, Math.max(3, Math.sqrt(room) / 9));
    this.uavSize = this.picture.uavs.size > 40 ? 8 : 11;
  }

  #run(wallMs) {
    requestAnimationFrame((next) => this.#run(next));
    if (wallMs - this.lastMs < BETWEEN_MS) return;
    this.lastMs = wallMs;
    if (this.motion.step(wallMs)) this.movingDirty = true;
    if (this.groundDirty || this.movingDirty) this.#paint();
  }

  #paint() {
    if (!this.picture.head) return;
    if (this.taskSize === undefined) this.#measure();
    const size = this.map.getSize();
    const corner = this.map.getPixelBounds().min;
    const view = new View(this.projection, 2 ** this.map.getZoom(), corner.x, corner.y, size.x, size.y);
    const look = this.#look();
    if (this.groundDirty) {
      const context = this.#context(this.ground, size);
      timed("ground", () => paintGround(context, view, this.picture, this.motion, look, this.taskSpots));
    }
    const context = this.#context(this.moving, size);
    timed("moving", () => paintUavs(context, view, this.picture, this.motion, look, this.uavSpots));
    this.groundDirty = this.movingDirty = false;
  }

  #look() {
    const which = this.listsShown;
    return {
      ink: this.ink,
      grid: this.projection === PLANE,
      size: this.taskSize,
      mostValue: this.mostValue ?? 1,
      uavSize: this.uavSize,
      selected: this.selected,
      layer: this.layer,
      ghosts: this.ghosts,
      corners: this.corners,
      showsList: (uav) => which === "all" || (which === "selected" && uav === this.selected),
    };
  }

  #context(canvas, { x: width, y: height }) {
    const ratio = window.devicePixelRatio || 1;
    const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== across || canvas.height !== down) {
      canvas.width = across;
      canvas.height = down;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return context;
  }

  #click({ latlng, containerPoint }) {
    if (this.isPlacing) {
      this.on.place([...this.projection.fromLeaflet(latlng), 0]);
      return;
    }
    const found = this.#at(containerPoint);
    this.on.select(found?.[0] ?? null, found?.[1] ?? null);
  }

  #hover(event) {
    const found = event && !this.isPlacing ? this.#at(event.containerPoint) : null;
    this.container.classList.toggle("over", Boolean(found));
    this.on.readout(event ? place(this.projection.fromLeaflet(event.latlng)) : "");
    this.hint.hidden = !found;
    if (!found) return;
    setText(this.hint, this.#hintOf(...found));
    const { x, y } = event.containerPoint;
    const right = x > this.map.getSize().x - 220;
    this.hint.style.transform = `translate(${x + (right ? -14 : 14)}px, ${y + 14}px)${right ? " translateX(-100%)" : ""}`;
  }

  #hintOf(kind, id) {
    if (kind === "uav") {
      const uav = this.picture.uavs.get(id);
      const goal = uav.task ?? uav.base;
      const height = uav.height_m === null ? "" : ` · ${number(uav.height_m, 0)} m`;
      return `${id} · ${uav.visit ?? uav.does}${goal ? ` → ${goal}` : ""}${height}`;
    }
    const task = this.picture.tasks.get(id);
    return `${id} · ${stateWord(taskState(task), task)}${task.uav ? ` · ${task.uav}` : ""} · value ${number(task.value)}`;
  }

  /** What lies under a point: `[kind, id]` or null; UAVs go first. */
  #at({ x, y }) {
    const near = (spots, reach) => {
      let [best, found] = [Infinity, null];
      for (const [id, [left, top]] of spots) {
        const away = Math.hypot(left - x, top - y);
        if (away < best && away <= reach(id)) [best, found] = [away, id];
      }
      return found;
    };
    const uav = near(this.uavSpots, () => 14);
    if (uav) return ["uav", uav];
    const look = { size: this.taskSize, mostValue: this.mostValue };
    const task = near(this.taskSpots, (id) =>
      Math.max(11, taskRadius(this.picture.tasks.get(id) ?? { value: 0 }, look) + 4),
    );
    return task ? ["task", task] : null;
  }
}

/** Leaflet takes the credit as markup; ours is text. */
function escaped(text) {
  return make("i", {}, text).innerHTML;
}
