// A floor plan under the map: an image, its scale, turn and place. It is kept in this browser.

import { el, fill, labelled } from "./dom.js";

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
  constructor(box, map, { say, changed }) {
    Object.assign(this, { map, say, changed, plan: null });
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
    const remove = el("button", { type: "button", onclick: () => this.remove() }, "Take it away");
    this.fields = el(
      "div",
      { hidden: true },
      el(
        "form",
        { onsubmit: (event) => event.preventDefault() },
        FIELDS.map(([name, words]) => labelled(words, this.inputs.get(name))),
        remove,
      ),
    );
    fill(
      box,
      labelled("image of the floor plan", file),
      this.fields,
      el("p", { class: "soft" }, "It is kept in this browser, and nowhere else."),
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
    for (const [name, input] of this.inputs) input.value = placing[name];
    this.fields.hidden = false;
    this.changed(this.plan);
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
