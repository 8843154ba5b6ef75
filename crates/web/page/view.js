// Where the canvas looks: metres of the map frame (x forward, y left; here x to the right and y up)
// to pixels, and what the pointer and the keys do to it.

const MOST_PIXELS_A_METRE = 2000;
const LEAST_PIXELS_A_METRE = 0.02;

export class View {
  // `grabbed` is asked when a pointer comes down: what it returns is called with the places to which
  // it is dragged, in place of moving the map.
  constructor(canvas, { moved, clicked, pointed, grabbed = () => null }) {
    Object.assign(this, { canvas, moved, clicked, pointed, grabbed, scale: 40, x: 0, y: 0, width: 0, height: 0 });
    this.isMoved = false; // by somebody
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas);
    this.resize();
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    Object.assign(this, { width, height, ratio });
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.moved();
  }

  toPixels(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toMetres(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  fit([west, south, east, north]) {
    const [wide, high] = [Math.max(east - west, 1), Math.max(north - south, 1)];
    this.scale = Math.min(this.width / wide, this.height / high) * 0.92 || 40;
    this.x = (west + east) / 2;
    this.y = (south + north) / 2;
    this.isMoved = false;
    this.moved();
  }

  // Brings a place into the middle.
  show([x, y]) {
    Object.assign(this, { x, y, scale: Math.max(this.scale, 30), isMoved: true });
    this.moved();
  }

  zoom(factor, [px, py] = [this.width / 2, this.height / 2]) {
    const [x, y] = this.toMetres(px, py);
    this.scale = Math.min(Math.max(this.scale * factor, LEAST_PIXELS_A_METRE), MOST_PIXELS_A_METRE);
    const [nowX, nowY] = this.toMetres(px, py);
    this.x += x - nowX;
    this.y += y - nowY;
    this.isMoved = true;
    this.moved();
  }

  pan(px, py) {
    this.x -= px / this.scale;
    this.y += py / this.scale;
    this.isMoved = true;
    this.moved();
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    if (event.button) return;
    const at = this.at(event);
    this.canvas.setPointerCapture(event.pointerId);
    const drags = this.pointers.size ? null : this.grabbed(this.toMetres(...at));
    this.pointers.set(event.pointerId, { at, travelled: 0, drags });
  }

  move(event) {
    const now = this.at(event);
    this.pointed(this.toMetres(...now));
    const held = this.pointers.get(event.pointerId);
    if (!held) return;
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, other]) => other.at);
    const [dx, dy] = [now[0] - held.at[0], now[1] - held.at[1]];
    if (others.length === 1) {
      const span = (at) => Math.hypot(at[0] - others[0][0], at[1] - others[0][1]) || 1;
      this.zoom(span(now) / span(held.at), others[0]);
    } else if (held.drags) {
      held.drags(this.toMetres(...now));
    } else {
      this.pan(dx, dy);
    }
    held.at = now;
    held.travelled += Math.hypot(dx, dy) + (others.length ? 10 : 0);
  }

  up(event) {
    const held = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    // A finger is less steady than a mouse.
    if (held && held.travelled < (event.pointerType === "mouse" ? 5 : 12))
      this.clicked(this.toMetres(...this.at(event)));
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), this.at(event));
  }

  // Enter is a click in the middle, where a cross is while the map has the focus.
  key(event) {
    const step = 60;
    const does = {
      ArrowLeft: () => this.pan(step, 0),
      ArrowRight: () => this.pan(-step, 0),
      ArrowUp: () => this.pan(0, step),
      ArrowDown: () => this.pan(0, -step),
      "+": () => this.zoom(1.25),
      "-": () => this.zoom(0.8),
      "=": () => this.zoom(1.25),
      Enter: () => this.clicked([this.x, this.y]),
    }[event.key];
    if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    does();
    this.pointed([this.x, this.y]);
  }

  end() {
    this.observer.disconnect();
  }
}
