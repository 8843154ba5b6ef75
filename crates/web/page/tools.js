// What a click on the map means.

import { el, fill, metres } from "./dom.js";
import { distance, lengthOf, nearest, toLine } from "./geometry.js";
import { edgesOf } from "./map_store.js";

const TOOLS = [
  { id: "look", label: "Look", hint: "Drag to move, wheel or + and − to zoom. Click what you want to know about." },
  { id: "path", label: "Path", hint: "Click the start, then the goal." },
  { id: "measure", label: "Measure", hint: "Click points; the distance along them is shown." },
  { id: "place", label: "Name a place", hint: "Click where the place is, then name it.", changes: true },
  {
    id: "zone",
    label: "Draw a zone",
    hint: "Click the corners in turn; drag one to move it. Then name the zone.",
    changes: true,
  },
  { id: "edge", label: "Close an edge", hint: "Click an edge, then close or open it.", changes: true },
  {
    id: "erase",
    label: "Erase",
    hint: "Click the corners of the part that is to go, then erase its nodes.",
    changes: true,
  },
];

const NEAR_PX = 14;

export class Tools {
  // `chosen` is called with what a click has come to: { kind, … }.
  constructor(box, mayChange, { chosen, changed, say }) {
    Object.assign(this, { box, chosen, changed, say, active: "look" });
    this.tools = TOOLS.filter((tool) => mayChange || !tool.changes);
    this.clear();
    this.buttons = new Map(
      this.tools.map(({ id, label }) => [id, el("button", { type: "button", onclick: () => this.use(id) }, label)]),
    );
    fill(
      box,
      [...this.buttons.values()],
      el("button", { type: "button", onclick: () => this.use(this.active) }, "Clear"),
    );
    this.press();
    this.say(TOOLS[0].hint);
  }

  clear() {
    this.overlay = { path: null, ends: [], measured: [], corners: [], edge: null, preview: [] };
  }

  press() {
    for (const [id, button] of this.buttons) button.setAttribute("aria-pressed", String(id === this.active));
  }

  use(id) {
    this.active = id;
    this.clear();
    this.press();
    this.say(TOOLS.find((tool) => tool.id === id).hint);
    this.chosen({ kind: "begin", tool: id });
    this.changed();
  }

  get drawsCorners() {
    return this.active === "zone" || this.active === "erase";
  }

  // Corners that came otherwise: typed, or of a zone that is to be changed.
  setCorners(corners) {
    this.overlay.corners = corners;
    this.overlay.preview = [];
    this.changed();
  }

  click(at, store, view) {
    const { overlay, active } = this;
    const within = NEAR_PX / view.scale;
    if (active === "path") {
      overlay.ends = overlay.ends.length === 1 ? [...overlay.ends, at] : [at];
      overlay.path = null;
      this.chosen({ kind: "ends", ends: overlay.ends });
    } else if (active === "measure") {
      overlay.measured.push(at);
      this.say(metres(lengthOf(overlay.measured)));
    } else if (active === "place") {
      overlay.ends = [at];
      this.chosen({ kind: "place", at });
    } else if (this.drawsCorners) {
      this.setCorners([...overlay.corners, at]);
      this.chosen({ kind: active, corners: overlay.corners });
    } else if (active === "edge") {
      const found = nearest(edgesOf(store.nodes), ([a, b]) => toLine(at, [a.x, a.y], [b.x, b.y]), within);
      overlay.edge = found?.map(({ x, y }) => [x, y]);
      this.chosen({ kind: "edge", edge: found?.map(({ id }) => id) });
    } else {
      this.say(whatIsAt(at, store, within));
    }
    this.changed();
  }

  // A corner that is dragged.
  grab(at, view) {
    if (!this.drawsCorners) return null;
    const { corners } = this.overlay;
    const held = nearest(corners.keys(), (index) => distance(at, corners[index]), NEAR_PX / view.scale);
    if (held === null) return null;
    return (now) => {
      this.setCorners(this.overlay.corners.with(held, now));
      this.chosen({ kind: this.active, corners: this.overlay.corners });
    };
  }
}

function whatIsAt(at, store, within) {
  const robot = nearest(
    store.robots.values(),
    ({ map_from_base: pose }) => (pose ? distance(at, pose) : Infinity),
    within,
  );
  if (robot) return `robot ${robot.robot}, ${robot.state}`;
  const place = nearest(store.rules.places, ({ pose }) => distance(at, pose), within);
  if (place) return `place ${place.name}`;
  const node = nearest(store.nodes.values(), ({ x, y }) => distance(at, [x, y]), within);
  if (!node) return "nothing is there";
  return `${node.kind} node ${node.id}, trust ${node.trust ?? 100} %, ${node.neighbours.length} edges`;
}
