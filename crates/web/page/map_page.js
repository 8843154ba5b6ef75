// One map: the canvas, the tools over it, and what stands beside it.

import { drawAbout, drawRobots } from "./about_panels.js";
import { ChangePanel } from "./change_panel.js";
import { el, fill, section } from "./dom.js";
import { Drawing } from "./draw.js";
import { EarthPanel } from "./earth_panel.js";
import { locate } from "./geometry.js";
import { JournalPanel } from "./journal_panel.js";
import { Live } from "./live.js";
import { MapStore } from "./map_store.js";
import { PathPanel } from "./path_panel.js";
import { PlanPanel } from "./plan_panel.js";
import { ReleasePanel } from "./release_panel.js";
import { TimePanel } from "./time_panel.js";
import { Tools } from "./tools.js";
import { View } from "./view.js";

const FLEET_EVERY_MS = 2000;
const RULES_EVERY_MS = 10000; // what is blocked ends by itself
const PANELS_EVERY_MS = 150;

const LAYERS = [
  ["graph", "nodes and edges"],
  ["walls", "walls"],
  ["outlines", "rectangles"],
  ["names", "names"],
];
const PARTS = [
  ["path", "Path"],
  ["changes", "Places, zones, closures"],
  ["journal", "Changes"],
  ["releases", "Releases"],
  ["time", "Time"],
  ["robots", "Robots"],
  ["about", "Map"],
  ["plan", "Floor plan"],
  ["earth", "Where on earth"],
];

function layout(main, map) {
  const canvas = el("canvas", {
    tabindex: 0,
    role: "application",
    "aria-label": `Map ${map}. Arrow keys move it, plus and minus zoom, Enter clicks in the middle.`,
  });
  const boxes = Object.fromEntries(PARTS.map(([name]) => [name, el("div", {})]));
  const toolBox = el("div", { class: "tools", role: "toolbar", "aria-label": "What a click does" });
  const [said, under] = [el("span", { role: "status" }), el("span", { class: "soft" })];
  const corner = el("div", { class: "corner" });
  const isNarrow = matchMedia("(max-width: 52rem)").matches;
  // Before the map is there, nothing is known of what it has and has not.
  const side = el(
    "section",
    { class: "side", "aria-label": "About the map", "aria-busy": "true", tabindex: 0 },
    PARTS.map(([name, title]) => section(title, !isNarrow || name === "path", boxes[name])),
  );
  fill(
    main,
    el(
      "div",
      { class: "map" },
      el("h1", { class: "unseen" }, `Map ${map}`),
      el(
        "section",
        { class: "stage", "aria-label": "Map" },
        toolBox,
        el("div", { class: "canvas-box" }, canvas, corner),
        el("div", { class: "under" }, said, under),
      ),
      side,
    ),
  );
  return { canvas, boxes, toolBox, said, under, corner, side };
}

export function showMap(main, map, me) {
  const page = new MapPage(layout(main, map), map, me);
  return () => page.end();
}

class MapPage {
  constructor(made, map, me) {
    Object.assign(this, made, { hasEnded: false, isDue: false, isDrawn: false, differs: null, panelsAt: 0 });
    this.drawing = new Drawing(this.canvas);
    this.store = new MapStore(map, () => this.changed());
    this.view = new View(this.canvas, {
      moved: () => {
        this.soon();
        if (this.view?.isMoved) this.store.looksAt([this.view.x, this.view.y]);
      },
      clicked: (at) => this.tools.click(at, this.store, this.view),
      pointed: (at) => (this.under.textContent = this.coordinates(at)),
      grabbed: (at) => this.tools.grab(at, this.view),
    });
    this.fillPanels(me);
    fillCorner(this);
    this.drawPanels();
    this.follow(map);
  }

  say(text, kind = "") {
    this.said.textContent = text;
    this.said.className = kind;
  }

  coordinates([x, y]) {
    const here = `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`;
    const { datum } = this.store.rules;
    if (!datum) return here;
    const [latitude, longitude] = locate(datum, [x, y]);
    return `${here} · ${latitude.toFixed(7)}°, ${longitude.toFixed(7)}°`;
  }

  fillPanels(me) {
    const { boxes, store } = this;
    const say = (text, kind) => this.say(text, kind);
    // What is drawn over the map, or under it, is another.
    const draws = (set) => (found) => {
      set(found);
      this.soon();
    };
    this.path = new PathPanel(boxes.path, store, me, {
      say,
      found: draws((found) => (this.tools.overlay.path = found)),
    });
    this.changes = new ChangePanel(boxes.changes, store, me, {
      say,
      done: draws(() => this.tools.clear()),
      tools: () => this.tools,
      look: () => [this.view.x, this.view.y],
    });
    const { mayChange } = this.changes;
    const send = (order, words) => this.changes.send(order, words);
    this.journal = new JournalPanel(boxes.journal, store);
    this.releases = new ReleasePanel(boxes.releases, store, {
      mayChange,
      say,
      send,
      compared: draws((found) => (this.differs = found)),
    });
    this.time = new TimePanel(boxes.time, store, { say });
    const changed = draws((plan) => this.drawing.setPlan(plan));
    this.plan = new PlanPanel(boxes.plan, store, { say, changed, mayChange, send });
    this.earth = new EarthPanel(boxes.earth, store, { mayChange, send });
    this.tools = new Tools(this.toolBox, mayChange, {
      say,
      changed: () => this.soon(),
      chosen: (chosen) => (chosen.kind === "ends" ? this.path.take(chosen.ends) : this.changes.take(chosen)),
    });
  }

  follow(map) {
    const { store } = this;
    const failed = (refused) => {
      this.side.removeAttribute("aria-busy");
      this.say(refused.message, "bad");
    };
    const handlers = {
      head: (head) => store.takeHead(head),
      grown: (grown) => store.takeGrown(grown),
      robots: (moved) => store.takeRobots(moved),
      goals: (goals) => store.takeGoals(goals),
      gone: (gone) => store.takeGone(gone),
      blocked: () => store.loadRules().catch(failed),
    };
    const opened = () =>
      store
        .load(store.near)
        .then(() => store.loadFleet())
        .catch(failed);
    this.live = new Live(`/api/events/${encodeURIComponent(map)}`, handlers, opened);
    // Of a map that nobody has begun there is nothing to ask: an event tells of its first node.
    const often = (read, every) => setInterval(() => store.isLoaded && read().catch(() => {}), every);
    this.timers = [
      often(() => store.loadFleet(), FLEET_EVERY_MS),
      often(() => store.loadRules(), RULES_EVERY_MS),
      often(() => store.loadJournal(), RULES_EVERY_MS),
    ];
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.recolour = () => {
      this.drawing.recolour();
      this.soon();
    };
    this.dark.addEventListener("change", this.recolour);
    for (const name of ["focus", "blur"]) this.canvas.addEventListener(name, () => this.soon());
  }

  // Many changes are one frame.
  soon() {
    if (this.isDue || this.hasEnded) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      if (!this.hasEnded) this.drawing.frame(this.view, this.store, { ...this.tools.overlay, differs: this.differs });
    });
  }

  changed() {
    if (this.hasEnded) return;
    const { store, view } = this;
    if (store.isLoaded) this.side.removeAttribute("aria-busy");
    // For those who measure how long it took.
    if (store.nodes.size && !this.isDrawn) requestAnimationFrame(() => performance.mark("map drawn"));
    this.isDrawn ||= store.nodes.size > 0;
    // A map that grows stays in sight until somebody moves it.
    if (!view.isMoved && !store.past && store.nodes.size) view.fit(store.bounds());
    this.soon();
    // What comes after a while is shown at once, and what comes often not each time.
    const wait = Math.max(0, this.panelsAt + PANELS_EVERY_MS - performance.now());
    this.panelsTimer ??= setTimeout(() => this.drawPanels(), wait);
  }

  drawPanels() {
    this.panelsTimer = undefined;
    this.panelsAt = performance.now();
    if (this.hasEnded) return;
    drawRobots(this.boxes.robots, this.store, (at) => this.view.show(at));
    drawAbout(this.boxes.about, this.store);
    const { path, changes, journal, releases, time, plan, earth } = this;
    for (const panel of [path, changes, journal, releases, time, plan, earth]) panel.draw();
  }

  end() {
    this.hasEnded = true;
    for (const part of [this.live, this.store, this.view, this.time]) part.end();
    this.timers.forEach(clearInterval);
    clearTimeout(this.panelsTimer);
    this.dark.removeEventListener("change", this.recolour);
  }
}

// Zoom for those without a wheel, and what is drawn.
function fillCorner(page) {
  const { corner, view, drawing, store } = page;
  const button = (sign, label, does) =>
    el("button", { type: "button", "aria-label": label, title: label, onclick: does }, sign);
  const layer = ([name, words]) => {
    const box = el("input", { type: "checkbox", checked: drawing.layers[name] });
    box.addEventListener("change", () => {
      drawing.setLayer(name, box.checked);
      page.soon();
    });
    return el("label", {}, box, words);
  };
  fill(
    corner,
    button("+", "Zoom in", () => view.zoom(1.4)),
    button("−", "Zoom out", () => view.zoom(1 / 1.4)),
    button("⤢", "The whole map", () => view.fit(store.bounds())),
    el("details", { class: "layers" }, el("summary", {}, "Layers"), LAYERS.map(layer)),
  );
}
