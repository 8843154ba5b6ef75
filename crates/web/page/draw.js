// One frame: what the map has, kept as a picture while it stays the same, and over it what moves:
// robots, what is asked and drawn just now, what differs.

import { Pen, readColours } from "./pen.js";
import { drawStill } from "./still.js";

const MOST_NAMES = 60; // of more robots only the dots are drawn

export class Drawing {
  constructor(canvas) {
    this.context = canvas.getContext("2d", { alpha: false });
    this.still = document.createElement("canvas");
    this.layers = { graph: true, walls: true, outlines: true, names: true };
    this.recolour();
  }

  recolour() {
    this.colours = readColours();
    this.drawn = "";
  }

  // A floor plan under the map; null: none.
  setPlan(plan) {
    this.plan = plan;
    this.drawn = "";
  }

  setLayer(name, isOn) {
    this.layers[name] = isOn;
    this.drawn = "";
  }

  frame(view, store, overlay) {
    const { context, still } = this;
    if (!view.width || !view.height) return;
    const now = [view.x, view.y, view.scale, view.width, view.height, view.ratio, store.drawing].join();
    if (now !== this.drawn) {
      this.drawn = now;
      [still.width, still.height] = [view.canvas.width, view.canvas.height];
      drawStill(still.getContext("2d", { alpha: false }), view, store, this);
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(still, 0, 0);
    const pen = new Pen(context, view, this.colours);
    if (overlay.differs) differences(pen, overlay.differs);
    if (!store.past) for (const blocked of store.rules.blocked) drawBlocked(pen, blocked, store);
    asked(pen, overlay);
    if (!store.past) {
      for (const { corners } of store.ways.values()) way(pen, corners);
      robots(pen, [...store.robots.values()]);
    }
    scaleBar(pen);
    if (store.past) stamp(pen, `as it was at version ${store.past.version}`);
    if (view.canvas.matches(":focus-visible")) cross(pen);
  }
}

function drawBlocked(pen, { robot, for_s: seconds, edges = [], places = [] }, store) {
  for (const [a, b] of edges.map((edge) => edge.map((id) => store.nodes.get(id)))) {
    if (a && b)
      pen.line(
        [
          [a.x, a.y],
          [b.x, b.y],
        ],
        pen.colours.blocked,
        4,
      );
  }
  for (const [x, y] of places) {
    pen.dot(x, y, Math.max(5, (0.3 * pen.view.scale) / pen.unit), pen.colours.blocked);
    pen.text(x, y, `${robot}: blocked for ${Math.round(seconds)} s more`, pen.colours.blocked);
  }
}

// Where a robot that was sent drives.
function way(pen, corners) {
  if (!corners.length) return;
  pen.line(corners, pen.colours.robot, 3, [7, 5]);
  pen.ring(...corners.at(-1), 6, pen.colours.robot);
}

function robots(pen, all) {
  const seen = all.filter(({ map_from_base: pose, candidates = [] }) =>
    [pose, ...candidates].some((at) => at && pen.sees(at[0], at[1], 1)),
  );
  const withNames = seen.length <= MOST_NAMES;
  for (const robot of seen) drawRobot(pen, robot, withNames);
}

function drawRobot(pen, told, withName) {
  const { robot, state, map_from_base: pose, candidates = [] } = told;
  const { colours, context } = pen;
  for (const [index, [x, y, yaw]] of candidates.entries()) {
    context.globalAlpha = index ? 0.6 : 1;
    pen.heading(x, y, yaw, colours.candidate, index ? 4 : 6);
    pen.ring(x, y, 9, colours.candidate);
    context.globalAlpha = 1;
    if (withName) pen.text(x, y, `${robot}? ${chance(index, told)}`, colours.candidate);
  }
  if (!pose) return;
  const isSure = state === "LOCALIZED";
  pen.heading(pose[0], pose[1], pose[2], isSure ? colours.robot : colours.blocked, 7);
  if (withName || !isSure) pen.text(pose[0], pose[1], isSure ? robot : `${robot} (${state})`, colours.robot);
}

// A robot says how probable each place is. One of an earlier version says it of the likeliest: the
// others share the rest.
function chance(index, { candidates, probabilities = [], confidence = 0 }) {
  const percent = (share) => `${Math.round(100 * share)} %`;
  if (index < probabilities.length) return percent(probabilities[index]);
  if (index === 0) return percent(confidence);
  return candidates.length === 2
    ? `at most ${percent(1 - confidence)}`
    : `number ${index + 1}, at most ${percent(Math.min(confidence, 1 - confidence))}`;
}

// What is asked and drawn just now.
function asked(pen, { path, ends = [], measured = [], corners = [], edge, preview = [] }) {
  const { colours } = pen;
  for (const { before, after } of preview) {
    if (before) pen.line(before, colours.gone, 3, [3, 5]);
    if (after) pen.line(after, colours.added, 4);
  }
  if (path) {
    const way = path.waypoints.map(({ x, y }) => [x, y]);
    pen.line(way, colours.ground, 7);
    pen.line(way, colours.path, 4);
  }
  for (const [index, [x, y]] of ends.entries()) {
    pen.dot(x, y, 6, colours.path);
    if (ends.length === 2) pen.text(x, y, index ? "goal" : "start", colours.path);
  }
  if (measured.length) pen.line(measured, colours.ink, 2, [4, 3]);
  for (const [x, y] of measured) pen.dot(x, y, 4, colours.ink);
  if (edge) pen.line(edge, colours.path, 5);
  if (corners.length) {
    pen.area(corners, colours["keep-out"], 0.12);
    pen.line([...corners, corners[0]], colours["keep-out"], 2, [4, 3]);
  }
  for (const [x, y] of corners) {
    pen.dot(x, y, 7, colours["keep-out"]);
    pen.dot(x, y, 4, colours.ground);
  }
}

function differences(pen, { added, gone, moved }) {
  const { colours } = pen;
  const outline = (node, colour, alpha) => {
    const rect = node.free_space;
    if (!rect) return;
    const [west, south, east, north] = rect;
    pen.area(
      [
        [west, south],
        [east, south],
        [east, north],
        [west, north],
      ],
      colour,
      alpha,
    );
  };
  for (const node of gone) outline(node, colours.gone, 0.12);
  for (const node of added) outline(node, colours.added, 0.12);
  for (const node of gone) pen.dot(node.x, node.y, 5, colours.gone);
  for (const node of added) pen.dot(node.x, node.y, 5, colours.added);
  for (const [was, node] of moved) {
    pen.line(
      [
        [was.x, was.y],
        [node.x, node.y],
      ],
      colours.moved,
      3,
    );
    pen.ring(node.x, node.y, 5, colours.moved);
  }
}

function scaleBar(pen) {
  const { context, view, colours, unit } = pen;
  const wanted = (100 * unit) / view.scale;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const metres = [5, 2, 1].map((step) => step * power).find((length) => length <= wanted) ?? power;
  const [left, base] = [12 * unit, view.height - 14 * unit];
  context.fillStyle = colours.ink;
  context.fillRect(left, base, metres * view.scale, 3 * unit);
  context.fillText(
    metres >= 0.01 ? `${metres >= 1 ? metres : metres.toFixed(2)} m` : `${metres * 1000} mm`,
    left,
    base - 5 * unit,
  );
}

// An earlier state must not be taken for the newest.
function stamp(pen, text) {
  const { context, colours, unit } = pen;
  context.font = `600 ${15 * unit}px system-ui, sans-serif`;
  context.fillStyle = colours.moved;
  context.fillText(text, 12 * unit, 24 * unit);
}

function cross(pen) {
  const { context, view, colours, unit } = pen;
  const [x, y] = [view.width / 2, view.height / 2];
  for (const [colour, width] of [
    [colours.ground, 4],
    [colours.ink, 1.5],
  ]) {
    context.strokeStyle = colour;
    context.lineWidth = width * unit;
    context.beginPath();
    context.moveTo(x - 9 * unit, y);
    context.lineTo(x + 9 * unit, y);
    context.moveTo(x, y - 9 * unit);
    context.lineTo(x, y + 9 * unit);
    context.stroke();
  }
}
