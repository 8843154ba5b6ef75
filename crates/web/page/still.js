// What the map has: drawn again only when the map or the view is another. What lies outside is
// left out, and details that would be smaller than a pixel or two, too.

import { edgesOf } from "./map_store.js";
import { Pen } from "./pen.js";

export function drawStill(context, view, store, { colours, layers, plan }) {
  const pen = new Pen(context, view, colours);
  const shown = store.shown();
  context.fillStyle = colours.ground;
  context.fillRect(0, 0, view.width, view.height);
  if (plan) floorPlan(pen, plan);
  rectangles(pen, shown.nodes.values(), layers.outlines, plan ? 0.5 : 1);
  if (layers.walls) walls(pen, shown.walls);
  if (layers.graph) {
    edges(pen, shown.nodes);
    nodes(pen, shown.nodes.values());
  }
  for (const zone of shown.rules.zones) drawZone(pen, zone, layers.names);
  for (const [a, b] of shown.rules.closed_edges) closed(pen, shown.nodes.get(a), shown.nodes.get(b));
  for (const place of shown.rules.places) drawPlace(pen, place, layers.names);
}

// An image whose lower left corner lies somewhere, and which is turned about it.
function floorPlan(pen, { image, placing: { x, y, scale, turn, shade } }) {
  const { context, view } = pen;
  const side = scale * view.scale;
  context.save();
  context.translate(...view.toPixels(x, y));
  context.rotate((-turn * Math.PI) / 180);
  context.globalAlpha = Math.min(1, Math.max(0, shade));
  context.drawImage(image, 0, -image.naturalHeight * side, image.naturalWidth * side, image.naturalHeight * side);
  context.restore();
}

function rectangles(pen, nodes, withOutlines, alpha) {
  const { context, view, colours } = pen;
  const [west, south, east, north] = pen.box;
  context.fillStyle = colours.free;
  context.globalAlpha = alpha;
  const shown = [];
  for (const { free_space: rect } of nodes) {
    if (!rect || rect[2] < west || rect[0] > east || rect[3] < south || rect[1] > north) continue;
    const [x, y] = view.toPixels(rect[0], rect[3]);
    const [w, h] = [(rect[2] - rect[0]) * view.scale, (rect[3] - rect[1]) * view.scale];
    context.fillRect(x, y, w, h);
    shown.push([x, y, w, h]);
  }
  context.globalAlpha = 1;
  if (view.scale < 12 || !withOutlines) return;
  context.strokeStyle = colours["free-line"];
  context.lineWidth = 1;
  context.globalAlpha = 0.4;
  for (const rect of shown) context.strokeRect(...rect);
  context.globalAlpha = 1;
}

function walls(pen, points) {
  const { context, view } = pen;
  context.fillStyle = pen.colours.wall;
  const side = Math.max(1, 0.05 * view.scale);
  for (let index = 0; index + 1 < points.length; index += 2) {
    const [x, y] = [points[index] / 100, points[index + 1] / 100];
    if (!pen.sees(x, y)) continue;
    const [px, py] = view.toPixels(x, y);
    context.fillRect(px - side / 2, py - side / 2, side, side);
  }
}

function edges(pen, nodes) {
  const { context, view } = pen;
  if (view.scale < 6) return;
  context.strokeStyle = pen.colours.edge;
  context.lineWidth = pen.unit;
  context.globalAlpha = 0.55;
  context.beginPath();
  for (const [a, b] of edgesOf(nodes)) {
    if (!pen.sees(a.x, a.y, 10) && !pen.sees(b.x, b.y, 10)) continue;
    context.moveTo(...view.toPixels(a.x, a.y));
    context.lineTo(...view.toPixels(b.x, b.y));
  }
  context.stroke();
  context.globalAlpha = 1;
}

function nodes(pen, all) {
  if (pen.view.scale < 6) return;
  for (const node of all) {
    if (!pen.sees(node.x, node.y)) continue;
    const isMain = node.kind === "main";
    pen.dot(node.x, node.y, isMain ? 4 : 2, pen.colours[isMain ? "main" : "support"]);
  }
}

export function drawZone(pen, { name, rule, corners }, withName = true) {
  if (!corners.length) return;
  const isClosed = rule === "keep_out";
  const colour = pen.colours[isClosed ? "keep-out" : "slow"];
  pen.area(corners, colour, 0.2);
  pen.line([...corners, corners[0]], colour, 2, isClosed ? [] : [6, 4]);
  if (withName) pen.text(...corners[0], isClosed ? name : `${name}, ${rule.speed_limit} m/s at most`, colour);
}

function closed(pen, a, b) {
  if (!a || !b) return;
  const colour = pen.colours.closed;
  pen.line(
    [
      [a.x, a.y],
      [b.x, b.y],
    ],
    colour,
    4,
  );
  const { context, view, unit } = pen;
  const [px, py] = view.toPixels((a.x + b.x) / 2, (a.y + b.y) / 2);
  context.lineWidth = 3 * unit;
  context.beginPath();
  for (const [dx, dy] of [
    [7, 7],
    [7, -7],
  ]) {
    context.moveTo(px - dx * unit, py - dy * unit);
    context.lineTo(px + dx * unit, py + dy * unit);
  }
  context.stroke();
}

function drawPlace(pen, { name, pose: [x, y, yaw] }, withName) {
  pen.heading(x, y, yaw, pen.colours.place);
  if (withName) pen.text(x, y, name, pen.colours.place);
}
