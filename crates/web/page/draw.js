// One frame: what the map has, what is asked, what robots do. What lies outside is left out, and
// details that would be smaller than a pixel or two, too.

const COLOURS = [
  "free", "free-line", "edge", "main", "support", "wall", "place", "keep-out", "slow", "closed", "blocked", "path",
  "robot", "candidate",
];

export function readColours() {
  const style = getComputedStyle(document.documentElement);
  const colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--map-${name}`).trim()]));
  return { ...colours, ink: style.getPropertyValue("--ink").trim(), ground: style.getPropertyValue("--ground").trim() };
}

export function draw(context, view, store, overlay, colours) {
  const pen = new Pen(context, view, colours);
  pen.clear();
  pen.rectangles(store.nodes.values());
  pen.walls(store.walls);
  pen.edges(store);
  pen.nodes(store.nodes.values());
  for (const zone of store.rules.zones) pen.zone(zone);
  for (const [a, b] of store.rules.closed_edges) pen.edge(store.nodes.get(a), store.nodes.get(b), "closed", 4);
  for (const blocked of store.rules.blocked) pen.blocked(blocked, store);
  for (const place of store.rules.places) pen.place(place);
  pen.overlay(overlay);
  for (const robot of store.robots.values()) pen.robot(robot);
  pen.scaleBar();
  if (document.activeElement === view.canvas) pen.cross();
}

class Pen {
  constructor(context, view, colours) {
    Object.assign(this, { context, view, colours });
    const [west, north] = view.toMetres(0, 0);
    const [east, south] = view.toMetres(view.width, view.height);
    this.box = [west, south, east, north];
  }

  clear() {
    const { context, view } = this;
    context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    context.fillStyle = this.colours.ground;
    context.fillRect(0, 0, view.width, view.height);
    context.font = "13px system-ui, sans-serif";
  }

  sees(x, y, around = 0) {
    const [west, south, east, north] = this.box;
    return x >= west - around && x <= east + around && y >= south - around && y <= north + around;
  }

  rectangles(nodes) {
    const { context, view, colours } = this;
    const [west, south, east, north] = this.box;
    context.fillStyle = colours.free;
    context.strokeStyle = colours["free-line"];
    context.lineWidth = 1;
    context.globalAlpha = 1;
    const shown = [];
    for (const { free_space: rect } of nodes) {
      if (!rect || rect[2] < west || rect[0] > east || rect[3] < south || rect[1] > north) continue;
      const [x, y] = view.toPixels(rect[0], rect[3]);
      const [w, h] = [(rect[2] - rect[0]) * view.scale, (rect[3] - rect[1]) * view.scale];
      context.fillRect(x, y, w, h);
      shown.push([x, y, w, h]);
    }
    if (view.scale < 12) return;
    context.globalAlpha = 0.45;
    for (const rect of shown) context.strokeRect(...rect);
    context.globalAlpha = 1;
  }

  walls(points) {
    const { context, view } = this;
    context.fillStyle = this.colours.wall;
    const side = Math.max(1, 0.05 * view.scale);
    for (let index = 0; index + 1 < points.length; index += 2) {
      const [x, y] = [points[index] / 100, points[index + 1] / 100];
      if (!this.sees(x, y)) continue;
      const [px, py] = view.toPixels(x, y);
      context.fillRect(px - side / 2, py - side / 2, side, side);
    }
  }

  edges(store) {
    if (this.view.scale < 6) return;
    const { context, view } = this;
    context.strokeStyle = this.colours.edge;
    context.lineWidth = 1;
    context.globalAlpha = 0.6;
    context.beginPath();
    for (const [a, b] of store.edges()) {
      if (!this.sees(a.x, a.y, 10) && !this.sees(b.x, b.y, 10)) continue;
      context.moveTo(...view.toPixels(a.x, a.y));
      context.lineTo(...view.toPixels(b.x, b.y));
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  nodes(nodes) {
    const { context, view, colours } = this;
    if (view.scale < 6) return;
    for (const node of nodes) {
      if (!this.sees(node.x, node.y)) continue;
      const isMain = node.kind === "main";
      this.dot(node.x, node.y, isMain ? 4 : 2, colours[isMain ? "main" : "support"]);
    }
    context.globalAlpha = 1;
  }

  dot(x, y, radius, colour) {
    const { context, view } = this;
    context.fillStyle = colour;
    context.beginPath();
    context.arc(...view.toPixels(x, y), radius, 0, 2 * Math.PI);
    context.fill();
  }

  line(points, colour, width, dashes = []) {
    const { context, view } = this;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dashes);
    context.beginPath();
    for (const [index, [x, y]] of points.entries()) {
      const at = view.toPixels(x, y);
      if (index) context.lineTo(...at);
      else context.moveTo(...at);
    }
    context.stroke();
    context.setLineDash([]);
  }

  text(x, y, text, colour) {
    const { context, view, colours } = this;
    const [px, py] = view.toPixels(x, y);
    context.lineWidth = 3;
    context.strokeStyle = colours.ground;
    context.strokeText(text, px + 8, py - 6);
    context.fillStyle = colour;
    context.fillText(text, px + 8, py - 6);
  }

  zone({ name, rule, corners }) {
    if (!corners.length) return;
    const { context, view, colours } = this;
    const isClosed = rule === "keep_out";
    const colour = colours[isClosed ? "keep-out" : "slow"];
    context.beginPath();
    for (const [x, y] of corners) context.lineTo(...view.toPixels(x, y));
    context.closePath();
    context.fillStyle = colour;
    context.globalAlpha = 0.18;
    context.fill("evenodd");
    context.globalAlpha = 1;
    this.line([...corners, corners[0]], colour, 2, isClosed ? [] : [6, 4]);
    const says = isClosed ? name : `${name}, ${rule.speed_limit} m/s at most`;
    this.text(...corners[0], says, colour);
  }

  edge(a, b, colour, width) {
    if (a && b) this.line([[a.x, a.y], [b.x, b.y]], this.colours[colour], width);
  }

  blocked({ robot, for_s: seconds, edges = [], places = [] }, store) {
    for (const [a, b] of edges) this.edge(store.nodes.get(a), store.nodes.get(b), "blocked", 4);
    for (const [x, y] of places) {
      this.dot(x, y, Math.max(5, 0.3 * this.view.scale), this.colours.blocked);
      this.text(x, y, `${robot}: blocked, ${Math.round(seconds)} s`, this.colours.blocked);
    }
  }

  place({ name, pose: [x, y, yaw] }) {
    this.heading(x, y, yaw, this.colours.place);
    this.text(x, y, name, this.colours.place);
  }

  heading(x, y, yaw, colour, radius = 6) {
    const far = (2.2 * radius) / this.view.scale;
    this.line([[x, y], [x + far * Math.cos(yaw), y + far * Math.sin(yaw)]], colour, 2);
    this.dot(x, y, radius, colour);
  }

  robot({ robot, state, map_from_base: pose, candidates = [], confidence }) {
    const { colours } = this;
    for (const [index, [x, y, yaw]] of candidates.entries()) {
      this.heading(x, y, yaw, colours.candidate, 4);
      const sure = index === 0 && confidence !== undefined ? ` ${Math.round(100 * confidence)} %` : "";
      this.text(x, y, `${robot}?${sure}`, colours.candidate);
    }
    if (!pose) return;
    this.heading(pose[0], pose[1], pose[2], colours.robot, 7);
    this.text(pose[0], pose[1], state === "LOCALIZED" ? robot : `${robot} (${state})`, colours.robot);
  }

  // What is asked and drawn just now.
  overlay({ path, ends = [], measured = [], corners = [] }) {
    const { colours } = this;
    if (path) this.line(path.waypoints.map(({ x, y }) => [x, y]), colours.path, 4);
    for (const [x, y] of ends) this.dot(x, y, 6, colours.path);
    if (measured.length) this.line(measured, colours.ink, 2, [4, 3]);
    for (const [x, y] of measured) this.dot(x, y, 4, colours.ink);
    if (corners.length) this.line([...corners, corners[0]], colours["keep-out"], 2, [4, 3]);
    for (const [x, y] of corners) this.dot(x, y, 4, colours["keep-out"]);
  }

  scaleBar() {
    const { context, view, colours } = this;
    const wanted = 100 / view.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const metres = [5, 2, 1].map((step) => step * power).find((length) => length <= wanted) ?? power;
    const [left, base] = [12, view.height - 14];
    context.fillStyle = colours.ink;
    context.fillRect(left, base, metres * view.scale, 3);
    context.fillText(`${metres} m`, left, base - 5);
  }

  cross() {
    const { context, view } = this;
    const [x, y] = [view.width / 2, view.height / 2];
    context.strokeStyle = this.colours.ink;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(x - 9, y);
    context.lineTo(x + 9, y);
    context.moveTo(x, y - 9);
    context.lineTo(x, y + 9);
    context.stroke();
  }
}
