// One map: the canvas, the tools over it, and what stands beside it.

import { el, fill } from "./dom.js";
import { draw, readColours } from "./draw.js";
import { Live } from "./live.js";
import { MapStore } from "./map_store.js";
import { ChangePanel, PathPanel, drawHealth, drawRobots } from "./panels.js";
import { Tools } from "./tools.js";
import { View } from "./view.js";

const FLEET_EVERY_MS = 2000;
const RULES_EVERY_MS = 10000; // what is blocked ends by itself

export function showMap(main, map, me) {
  const canvas = el("canvas", {
    tabindex: 0, role: "application",
    "aria-label": `Map ${map}. Arrow keys move it, plus and minus zoom, Enter clicks in the middle.`,
  });
  const boxes = Object.fromEntries(["tools", "path", "robots", "changes", "health"].map((name) => [name, el("div", {})]));
  boxes.tools.className = "tools";
  boxes.tools.setAttribute("role", "toolbar");
  boxes.tools.setAttribute("aria-label", "What a click does");
  const [said, under] = [el("span", { role: "status" }), el("span", { class: "soft" })];
  fill(main, el("div", { class: "map" },
    el("section", { class: "stage", "aria-label": "Map" }, boxes.tools, el("div", { class: "canvas-box" }, canvas),
      el("div", { class: "under" }, said, under)),
    el("section", { class: "side", "aria-label": "About the map" },
      boxes.path, boxes.changes, boxes.robots, boxes.health)));

  const context = canvas.getContext("2d");
  let [colours, isDue, isFitted, hasEnded] = [readColours(), false, false, false];
  const say = (text, kind = "") => {
    said.textContent = text;
    said.className = kind;
  };

  function frame() {
    isDue = false;
    if (!hasEnded) draw(context, view, store, tools.overlay, colours);
  }
  // Many changes are one frame.
  function soon() {
    if (!isDue && !hasEnded) {
      isDue = true;
      requestAnimationFrame(frame);
    }
  }
  function changed() {
    if (hasEnded) return;
    if (!isFitted && store.nodes.size) {
      isFitted = true;
      view.fit(store.bounds());
    }
    soon();
    panelsSoon();
  }
  let panelsTimer;
  function panelsSoon() {
    panelsTimer ??= setTimeout(() => {
      panelsTimer = undefined;
      if (hasEnded) return;
      drawRobots(boxes.robots, store);
      drawHealth(boxes.health, store);
      changes.draw();
    }, 300);
  }

  const store = new MapStore(map, changed);
  const path = new PathPanel(boxes.path, map, {
    say,
    found: (found) => {
      tools.overlay.path = found;
      soon();
    },
  });
  const changes = new ChangePanel(boxes.changes, store, me, {
    say,
    done: () => {
      tools.clear();
      soon();
    },
  });
  const tools = new Tools(boxes.tools, me.rights === "change", {
    say, changed: soon,
    chosen: (chosen) => (chosen.kind === "ends" ? path.take(chosen.ends) : changes.take(chosen)),
  });
  const view = new View(canvas, {
    moved: soon,
    clicked: (at) => tools.click(at, store, view),
    pointed: ([x, y]) => (under.textContent = `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`),
  });

  const failed = (refused) => say(refused.message, "bad");
  const opened = () => store.load(store.near).then(() => store.loadFleet()).catch(failed);
  const live = new Live(`/api/events/${encodeURIComponent(map)}`, {
    head: (head) => store.takeHead(head),
    grown: (grown) => store.takeGrown(grown),
    robots: (moved) => store.takeRobots(moved),
    gone: (gone) => store.takeGone(gone),
    blocked: () => store.loadRules().catch(failed),
  }, opened);
  const timers = [
    setInterval(() => store.loadFleet().catch(() => {}), FLEET_EVERY_MS),
    setInterval(() => store.loadRules().catch(() => {}), RULES_EVERY_MS),
  ];
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const recolour = () => {
    colours = readColours();
    soon();
  };
  dark.addEventListener("change", recolour);
  for (const name of ["focus", "blur"]) canvas.addEventListener(name, soon);

  return () => {
    hasEnded = true;
    live.end();
    store.end();
    view.end();
    timers.forEach(clearInterval);
    clearTimeout(panelsTimer);
    dark.removeEventListener("change", recolour);
  };
}
