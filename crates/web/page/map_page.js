// One map: the canvas, the tools over it, and what stands beside it.

import { drawAbout, drawRobots } from "./about_panels.js";
import { ChangePanel } from "./change_panel.js";
import { el, fill, section } from "./dom.js";
import { Drawing } from "./draw.js";
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
const PANELS_EVERY_MS = 300;

const LAYERS = [["graph", "nodes and edges"], ["walls", "walls"], ["outlines", "rectangles"], ["names", "names"]];
const PARTS = [["path", "Path"], ["changes", "Places, zones, closures"], ["releases", "Releases"], ["time", "Time"],
  ["robots", "Robots"], ["about", "Map"], ["plan", "Floor plan"]];

function layout(main, map) {
  const canvas = el("canvas", {
    tabindex: 0, role: "application",
    "aria-label": `Map ${map}. Arrow keys move it, plus and minus zoom, Enter clicks in the middle.`,
  });
  const boxes = Object.fromEntries(PARTS.map(([name]) => [name, el("div", {})]));
  const tools = el("div", { class: "tools", role: "toolbar", "aria-label": "What a click does" });
  const [said, under] = [el("span", { role: "status" }), el("span", { class: "soft" })];
  const corner = el("div", { class: "corner" });
  const isNarrow = matchMedia("(max-width: 52rem)").matches;
  fill(main, el("div", { class: "map" },
    el("h1", { class: "unseen" }, `Map ${map}`),
    el("section", { class: "stage", "aria-label": "Map" }, tools, el("div", { class: "canvas-box" }, canvas, corner),
      el("div", { class: "under" }, said, under)),
    el("section", { class: "side", "aria-label": "About the map", tabindex: 0 },
      PARTS.map(([name, title]) => section(title, !isNarrow || name === "path", boxes[name])))));
  return { canvas, boxes, tools, said, under, corner };
}

export function showMap(main, map, me) {
  const { canvas, boxes, tools: toolBox, said, under, corner } = layout(main, map);
  const drawing = new Drawing(canvas);
  let [isDue, isDrawn, hasEnded, differs, panelsTimer, panelsAt] = [false, false, false, null, undefined, 0];
  const say = (text, kind = "") => {
    said.textContent = text;
    said.className = kind;
  };

  function frame() {
    isDue = false;
    if (!hasEnded) drawing.frame(view, store, { ...tools.overlay, differs });
  }
  // Many changes are one frame.
  function soon() {
    if (isDue || hasEnded) return;
    isDue = true;
    requestAnimationFrame(frame);
  }
  function changed() {
    if (hasEnded) return;
    // For those who measure how long it took.
    if (store.nodes.size && !isDrawn) requestAnimationFrame(() => performance.mark("map drawn"));
    isDrawn ||= store.nodes.size > 0;
    // A map that grows stays in sight until somebody moves it.
    if (!view.isMoved && !store.past && store.nodes.size) view.fit(store.bounds());
    soon();
    // What comes after a while is shown at once, and what comes often not each time.
    panelsTimer ??= setTimeout(drawPanels, Math.max(0, panelsAt + PANELS_EVERY_MS - performance.now()));
  }
  function drawPanels() {
    panelsTimer = undefined;
    panelsAt = performance.now();
    if (hasEnded) return;
    drawRobots(boxes.robots, store, (at) => view.show(at));
    drawAbout(boxes.about, store);
    for (const panel of [path, changes, releases, time]) panel.draw();
  }

  const store = new MapStore(map, changed);
  const view = new View(canvas, {
    moved: soon,
    clicked: (at) => tools.click(at, store, view),
    pointed: ([x, y]) => (under.textContent = `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`),
    grabbed: (at) => tools.grab(at, view),
  });
  const path = new PathPanel(boxes.path, store, me, {
    say,
    found: (found) => {
      tools.overlay.path = found;
      soon();
    },
  });
  const done = () => {
    tools.clear();
    soon();
  };
  const changes = new ChangePanel(boxes.changes, store, me, { say, done, tools: () => tools, look: () => [view.x, view.y] });
  const releases = new ReleasePanel(boxes.releases, store, {
    mayChange: changes.mayChange, say,
    send: (order, words) => changes.send(order, words),
    compared: (found) => {
      differs = found;
      soon();
    },
  });
  const time = new TimePanel(boxes.time, store, { say });
  new PlanPanel(boxes.plan, map, {
    say,
    changed: (plan) => {
      drawing.setPlan(plan);
      soon();
    },
  });
  const tools = new Tools(toolBox, changes.mayChange, {
    say, changed: soon,
    chosen: (chosen) => (chosen.kind === "ends" ? path.take(chosen.ends) : changes.take(chosen)),
  });
  fillCorner(corner, view, drawing, () => view.fit(store.bounds()), soon);
  drawPanels();

  const failed = (refused) => say(refused.message, "bad");
  const live = new Live(`/api/events/${encodeURIComponent(map)}`, {
    head: (head) => store.takeHead(head),
    grown: (grown) => store.takeGrown(grown),
    robots: (moved) => store.takeRobots(moved),
    goals: (goals) => store.takeGoals(goals),
    gone: (gone) => store.takeGone(gone),
    blocked: () => store.loadRules().catch(failed),
  }, () => store.load(store.near).then(() => store.loadFleet()).catch(failed));
  const timers = [
    setInterval(() => store.loadFleet().catch(() => {}), FLEET_EVERY_MS),
    setInterval(() => store.loadRules().catch(() => {}), RULES_EVERY_MS),
  ];
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const recolour = () => {
    drawing.recolour();
    soon();
  };
  dark.addEventListener("change", recolour);
  for (const name of ["focus", "blur"]) canvas.addEventListener(name, soon);

  return () => {
    hasEnded = true;
    live.end();
    store.end();
    view.end();
    time.end();
    timers.forEach(clearInterval);
    clearTimeout(panelsTimer);
    dark.removeEventListener("change", recolour);
  };
}

// Zoom for those without a wheel, and what is drawn.
function fillCorner(corner, view, drawing, fit, soon) {
  const button = (sign, label, does) => el("button", { type: "button", "aria-label": label, title: label, onclick: does }, sign);
  const layer = ([name, words]) => {
    const box = el("input", { type: "checkbox", checked: drawing.layers[name] });
    box.addEventListener("change", () => {
      drawing.setLayer(name, box.checked);
      soon();
    });
    return el("label", {}, box, words);
  };
  fill(corner, button("+", "Zoom in", () => view.zoom(1.4)), button("−", "Zoom out", () => view.zoom(1 / 1.4)),
    button("⤢", "The whole map", fit),
    el("details", { class: "layers" }, el("summary", {}, "Layers"), LAYERS.map(layer)));
}
