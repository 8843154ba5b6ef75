// Where on earth the map is: latitude and longitude of its origin, and how it is turned.

import { el, fill, labelled } from "./dom.js";
import { toDegrees } from "./geometry.js";

const FIELDS = [
  ["latitude", "latitude of the origin, °", -89.9, 89.9],
  ["longitude", "longitude of the origin, °", -180, 180],
  ["turn", "x axis, ° from east", -360, 360],
];

export class EarthPanel {
  constructor(box, store, { mayChange, send }) {
    Object.assign(this, { store, told: undefined });
    this.words = el("p", {});
    fill(box, this.words);
    if (!mayChange) return;
    this.inputs = new Map(
      FIELDS.map(([name, , min, max]) => [
        name,
        el("input", { type: "number", step: "any", required: true, min, max, value: name === "turn" ? 0 : null }),
      ]),
    );
    const save = (event) => {
      event.preventDefault();
      const [latitude, longitude, turn] = FIELDS.map(([name]) => Number(this.inputs.get(name).value));
      const datum = { latitude, longitude, yaw: (turn * Math.PI) / 180 };
      send({ op: "set_datum", datum }, "where on earth the map is, is written");
    };
    const strike = () => send({ op: "set_datum", datum: null }, "where on earth the map is, is taken away");
    this.strike = el("button", { type: "button", hidden: true, onclick: strike }, "Take it away");
    const form = el(
      "form",
      { onsubmit: save },
      FIELDS.map(([name, words]) => labelled(words, this.inputs.get(name))),
      el("button", {}, "Save where it is"),
      this.strike,
    );
    box.append(form);
  }

  draw() {
    const { datum } = this.store.rules;
    const told = JSON.stringify(datum ?? null);
    if (told === this.told) return;
    this.told = told;
    const turn = datum ? toDegrees(datum.yaw) : 0;
    this.words.textContent = datum
      ? `The origin is at latitude ${datum.latitude}°, longitude ${datum.longitude}°; x points ${turn}° from east.`
      : "Nobody has said where on earth this map is.";
    if (!this.inputs) return;
    this.strike.hidden = !datum;
    if (!datum) return;
    for (const [name, value] of Object.entries({ ...datum, turn })) {
      if (this.inputs.has(name)) this.inputs.get(name).value = value;
    }
  }
}
