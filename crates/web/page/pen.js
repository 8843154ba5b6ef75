// Shapes in metres on a canvas in pixels. Sizes of dots and letters follow the page's letters.

const COLOURS = [
  "free",
  "free-line",
  "edge",
  "main",
  "support",
  "wall",
  "place",
  "keep-out",
  "slow",
  "closed",
  "blocked",
  "path",
  "robot",
  "candidate",
  "added",
  "gone",
  "moved",
];

export function readColours() {
  const style = getComputedStyle(document.documentElement);
  const colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--map-${name}`).trim()]));
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  return { ...colours, ink: read("ink"), ground: read("ground"), unit: Number.parseFloat(style.fontSize) / 15 };
}

export class Pen {
  constructor(context, view, colours) {
    Object.assign(this, { context, view, colours, unit: colours.unit });
    const [west, north] = view.toMetres(0, 0);
    const [east, south] = view.toMetres(view.width, view.height);
    this.box = [west, south, east, north];
    context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    context.font = `${13 * this.unit}px system-ui, sans-serif`;
    context.lineJoin = "round";
  }

  sees(x, y, around = 0) {
    const [west, south, east, north] = this.box;
    return x >= west - around && x <= east + around && y >= south - around && y <= north + around;
  }

  dot(x, y, radius, colour) {
    const { context, view } = this;
    context.fillStyle = colour;
    context.beginPath();
    context.arc(...view.toPixels(x, y), radius * this.unit, 0, 2 * Math.PI);
    context.fill();
  }

  ring(x, y, radius, colour) {
    const { context, view } = this;
    context.strokeStyle = colour;
    context.lineWidth = 2 * this.unit;
    context.beginPath();
    context.arc(...view.toPixels(x, y), radius * this.unit, 0, 2 * Math.PI);
    context.stroke();
  }

  line(points, colour, width, dashes = []) {
    const { context, view, unit } = this;
    context.strokeStyle = colour;
    context.lineWidth = width * unit;
    context.setLineDash(dashes.map((dash) => dash * unit));
    context.beginPath();
    for (const [x, y] of points) context.lineTo(...view.toPixels(x, y));
    context.stroke();
    context.setLineDash([]);
  }

  area(corners, colour, alpha) {
    const { context, view } = this;
    context.beginPath();
    for (const [x, y] of corners) context.lineTo(...view.toPixels(x, y));
    context.closePath();
    context.fillStyle = colour;
    context.globalAlpha = alpha;
    context.fill("evenodd");
    context.globalAlpha = 1;
  }

  text(x, y, text, colour) {
    const { context, view, colours, unit } = this;
    const [px, py] = view.toPixels(x, y);
    context.lineWidth = 3 * unit;
    context.strokeStyle = colours.ground;
    context.strokeText(text, px + 9 * unit, py - 7 * unit);
    context.fillStyle = colour;
    context.fillText(text, px + 9 * unit, py - 7 * unit);
  }

  // A dot with a nose.
  heading(x, y, yaw, colour, radius = 6) {
    const far = (2.2 * radius * this.unit) / this.view.scale;
    this.line(
      [
        [x, y],
        [x + far * Math.cos(yaw), y + far * Math.sin(yaw)],
      ],
      colour,
      2.5,
    );
    this.dot(x, y, radius, colour);
  }
}
