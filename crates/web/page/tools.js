// What a click on the map means.

import { el, fill, metres } from "./dom.js";

const TOOLS = [
  { id: "look", label: "Look", hint: "Drag to move, wheel or + and − to zoom. Enter clicks in the middle." },
  { id: "path", label: "Path", hint: "Click the start, then the goal." },
  { id: "measure", label: "Measure", hint: "Click points; the distance along them is shown." },
  { id: "place", label: "Name a place", hint: "Click where the place is, then name it.", changes: true },
  { id: "zone", label: "Draw a zone", hint: "Click the corners in turn, then name the zone.", changes: true },
  { id: "edge", label: "Close an edge", hint: "Click an edge, then close or open it.", changes: true },
];

export class Tools {
  // `chosen` is called with what a click has come to: { kind, … }.
  constructor(box, mayChange, { chosen, changed, say }) {
    Object.assign(this, { box, chosen, changed, say, active: "look" });
    this.tools = TOOLS.filter((tool) => mayChange || !tool.changes);
    this.clear();
    this.draw();
  }

  clear() {
    this.overlay = { path: null, ends: [], measured: [], corners: [] };
  }

  draw() {
    const button = ({ id, label }) => el("button", {
      type: "button", "aria-pressed": String(id === this.active), onclick: () => this.use(id),
    }, label);
    fill(this.box, this.tools.map(button), el("button", { type: "button", onclick: () => this.use(this.active) }, "Clear"));
  }

  use(id) {
    this.active = id;
    this.clear();
    this.draw();
    this.say(TOOLS.find((tool) => tool.id === id).hint);
    this.chosen({ kind: "begin", tool: id });
    this.changed();
  }

  click(at, store, view) {
    const overlay = this.overlay;
    if (this.active === "path") {
      overlay.ends = overlay.ends.length === 1 ? [...overlay.ends, at] : [at];
      overlay.path = null;
      this.chosen({ kind: "ends", ends: overlay.ends });
    } else if (this.active === "measure") {
      overlay.measured.push(at);
      this.say(metres(lengthOf(overlay.measured)));
    } else if (this.active === "place") {
      overlay.ends = [at];
      this.chosen({ kind: "place", at });
    } else if (this.active === "zone") {
      overlay.corners.push(at);
      this.chosen({ kind: "zone", corners: overlay.corners });
    } else if (this.active === "edge") {
      this.chosen({ kind: "edge", edge: nearestEdge(at, store, 14 / view.scale) });
    } else {
      this.say(whatIsAt(at, store, 14 / view.scale));
    }
    this.changed();
  }
}

function lengthOf(points) {
  let length = 0;
  for (let index = 1; index < points.length; index += 1) length += distance(points[index - 1], points[index]);
  return length;
}

function distance([ax, ay], [bx, by]) {
  return Math.hypot(ax - bx, ay - by);
}

function toLine([x, y], a, b) {
  const [dx, dy] = [b.x - a.x, b.y - a.y];
  const along = Math.min(1, Math.max(0, ((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(x - a.x - along * dx, y - a.y - along * dy);
}

function nearestEdge(at, store, within) {
  let [best, least] = [null, within];
  for (const [a, b] of store.edges()) {
    const far = toLine(at, a, b);
    if (far < least) [best, least] = [[a.id, b.id], far];
  }
  return best;
}

function whatIsAt(at, store, within) {
  for (const robot of store.robots.values()) {
    const pose = robot.map_from_base;
    if (pose && distance(at, pose) < within) return `robot ${robot.robot}, ${robot.state}`;
  }
  let [best, least] = [null, within];
  for (const node of store.nodes.values()) {
    const far = distance(at, [node.x, node.y]);
    if (far < least) [best, least] = [node, far];
  }
  if (!best) return "";
  return `${best.kind} node ${best.id}, trust ${best.trust ?? 100} %, ${best.neighbours.length} edges`;
}
