// A floor plan under the map: an image, its scale, turn and place. The image is kept in this browser;
// how it lies can be written into the map, and then holds for everybody who lays the image under it.

import { el, fill, labelled } from "./dom.js";
import { toDegrees } from "./geometry.js";

const MOST_BYTES = 20e6;
const START = { scale: 0.05, x: 0, y: 0, turn: 0, shade: 0.5 };
const FIELDS = [
  ["scale", "metres a pixel", 0.001],
  ["x", "lower left x, m", 0.05],
  ["y", "lower left y, m", 0.05],
  ["turn", "turned by, °", 0.5],
  ["shade", "strength, 0 to 1", 0.1],
];

export class PlanPanel {
  constructor(box, store, { say, changed, mayChange, send }) {
    Object.assign(this, { store, map: store.map, say, changed, mayChange, send, plan: null, told: null });
    const file = el("input", {
      type: "file",
      accept: "image/png,image/jpeg,image/webp,image/svg+xml",
      onchange: () => this.take(file.files[0]),
    });
    this.inputs = new Map(
      FIELDS.map(([name, , step]) => [
        name,
        el("input", {
          type: "number",
          step: "any",
          min: name === "scale" ? step : null,
          value: START[name],
          class: "short",
          oninput: () => this.move(),
        }),
      ]),
    );
    const remove = el("button", { type: "button", onclick: () => this.remove() }, "Take the image away");
    const write = el("button", { type: "button", onclick: () => this.write() }, "Write into the map how it lies");
    this.fields = el(
      "div",
      { hidden: true },
      el(
        "form",
        { onsubmit: (event) => event.preventDefault() },
        FIELDS.map(([name, words]) => labelled(words, this.inputs.get(name))),
        mayChange ? write : null,
        remove,
      ),
    );
    this.inMap = el("p", {});
    const strike = () => this.send({ op: "set_floor_plan", plan: null }, "the map says of no floor plan how it lies");
    this.strike = el("button", { type: "button", hidden: true, onclick: strike }, "Take it out of the map");
    fill(
      box,
      labelled("image of the floor plan", file),
      this.fields,
      this.inMap,
      this.strike,
      el("p", { class: "soft" }, "The image is kept in this browser, and nowhere else."),
    );
    this.load().catch(() => {});
  }

  async load() {
    const kept = await onPlans("readonly", (plans) => plans.get(this.map));
    if (kept) await this.show(kept.file, kept.placing);
  }

  async take(file) {
    if (!file) return;
    if (file.size > MOST_BYTES) return this.say("an image may have 20 MB", "bad");
    try {
      await this.show(file, this.plan?.placing ?? START);
      await this.keep();
    } catch {
      this.say("this is no image that the browser can read", "bad");
    }
  }

  async show(file, placing) {
    const address = URL.createObjectURL(file);
    const image = new Image();
    image.src = address;
    try {
      await image.decode();
    } finally {
      URL.revokeObjectURL(address);
    }
    this.plan = { image, file, placing };
    this.fields.hidden = false;
    this.place(this.inTheMap() ?? {});
  }

  // As the map says, of what is laid under it here.
  inTheMap() {
    const { floor_plan: plan } = this.store.rules;
    if (!plan) return null;
    const [x, y, yaw] = plan.map_from_image;
    return { scale: plan.metres_per_pixel, x, y, turn: toDegrees(yaw) };
  }

  place(placing) {
    this.plan.placing = { ...this.plan.placing, ...placing };
    for (const [name, input] of this.inputs) input.value = this.plan.placing[name];
    this.changed(this.plan);
  }

  // What the map says has come, or is another.
  draw() {
    const { floor_plan: plan } = this.store.rules;
    const told = JSON.stringify(plan ?? null);
    if (told === this.told) return;
    this.told = told;
    this.strike.hidden = !(plan && this.mayChange);
    const placing = this.inTheMap();
    this.inMap.textContent = placing
      ? `The map says: ${plan.image || "an image"}, ${placing.scale} m a pixel, lower left corner at ` +
        `${placing.x.toFixed(2)}, ${placing.y.toFixed(2)}, turned by ${placing.turn.toFixed(1)}°.`
      : "The map says of no floor plan how it lies.";
    if (placing && this.plan) {
      this.place(placing);
      this.keep().catch(() => {});
    }
  }

  async write() {
    const { file, placing } = this.plan;
    const { scale, x, y, turn } = placing;
    const plan = { image: file.name ?? "", metres_per_pixel: scale, map_from_image: [x, y, (turn * Math.PI) / 180] };
    await this.send({ op: "set_floor_plan", plan }, "how the floor plan lies is written");
  }

  move() {
    const values = [...this.inputs].map(([name, input]) => [name, Number(input.value)]);
    if (!this.plan || values.some(([, value]) => !Number.isFinite(value))) return;
    const placing = Object.fromEntries(values);
    this.plan = { ...this.plan, placing };
    this.changed(placing.scale > 0 ? this.plan : null);
    this.keep().catch(() => {});
  }

  keep() {
    const { file, placing } = this.plan;
    return onPlans("readwrite", (plans) => plans.put({ file, placing }, this.map));
  }

  remove() {
    this.plan = null;
    this.fields.hidden = true;
    this.changed(null);
    onPlans("readwrite", (plans) => plans.delete(this.map)).catch(() => {});
  }
}

// What is kept in the browser.
function onPlans(mode, does) {
  return new Promise((done, failed) => {
    const opening = indexedDB.open("fht", 1);
    opening.onupgradeneeded = () => opening.result.createObjectStore("plans");
    opening.onerror = () => failed(opening.error);
    opening.onsuccess = () => {
      const request = does(opening.result.transaction("plans", mode).objectStore("plans"));
      request.onsuccess = () => done(request.result);
      request.onerror = () => failed(request.error);
      opening.result.close();
    };
  });
}
