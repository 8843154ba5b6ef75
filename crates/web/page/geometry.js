// Points, lines and polygons in metres. Pure: tests run it without a browser.

export function distance([ax, ay], [bx, by]) {
  return Math.hypot(ax - bx, ay - by);
}

export function lengthOf(points) {
  let length = 0;
  for (let index = 1; index < points.length; index += 1) length += distance(points[index - 1], points[index]);
  return length;
}

// From a point to the line between two others.
export function toLine([x, y], [ax, ay], [bx, by]) {
  const [dx, dy] = [bx - ax, by - ay];
  const along = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(x - ax - along * dx, y - ay - along * dy);
}

// By the even-odd rule.
export function contains(corners, [x, y]) {
  let inside = false;
  for (let index = 0, before = corners.length - 1; index < corners.length; before = index, index += 1) {
    const [[ax, ay], [bx, by]] = [corners[index], corners[before]];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

// The thing for which `far` says least, if that is less than `within`.
export function nearest(things, far, within) {
  let [best, least] = [null, within];
  for (const thing of things) {
    const away = far(thing);
    if (away < least) [best, least] = [thing, away];
  }
  return best;
}

// Lines of `x,y` as people type them; null if one is none.
export function readPoints(text) {
  const lines = text
    .split("\n")
    .map((line) => line.trim())
    .filter((line) => line);
  const points = lines.map((line) => line.split(/[\s,;]+/).map(Number));
  return points.every((point) => point.length === 2 && point.every(Number.isFinite)) ? points : null;
}

// For people: to a thousandth.
export const toDegrees = (radians) => Number(((radians * 180) / Math.PI).toFixed(3));

export const point = ([x, y], digits = 3) => `${x.toFixed(digits)},${y.toFixed(digits)}`;

// Latitude and longitude, degrees, of a point of the map, in the plane that touches the earth at the
// map's origin. As `Datum::locate` has it (WGS 84).
export function locate({ latitude, longitude, yaw }, [x, y]) {
  const east = Math.cos(yaw) * x - Math.sin(yaw) * y;
  const north = Math.sin(yaw) * x + Math.cos(yaw) * y;
  const [axis, e2, radians] = [6378137, 6.69437999014e-3, (latitude * Math.PI) / 180];
  const w2 = 1 - e2 * Math.sin(radians) ** 2;
  const meridian = (axis * (1 - e2)) / (w2 * Math.sqrt(w2));
  const parallel = (axis / Math.sqrt(w2)) * Math.cos(radians);
  const degrees = (part) => (part * 180) / Math.PI;
  const turned = longitude + degrees(east / parallel) + 180;
  return [latitude + degrees(north / meridian), turned - 360 * Math.floor(turned / 360) - 180];
}
