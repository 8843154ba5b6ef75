// The map as it was: a slider over the versions that are kept, and its growth played.

import { askPast } from "./api.js";
import { el, fill, labelled } from "./dom.js";
import { pastOf } from "./map_store.js";

const STEPS = 40;
const STEP_MS = 200;

export class TimePanel {
  constructor(box, store, { say }) {
    Object.assign(this, { store, say, playing: false, oldest: 1, wanted: null, isAsking: false });
    this.slider = el("input", { type: "range", min: 1, max: 1, value: 1, oninput: () => this.move() });
    // Only who looks back asks how far.
    for (const name of ["focus", "pointerenter"]) this.slider.addEventListener(name, () => this.lookBack());
    this.shows = el("output", {}, "the newest state");
    this.play = el(
      "button",
      { type: "button", onclick: () => (this.playing ? this.stop() : this.run()) },
      "Play its growth",
    );
    this.now = el("button", { type: "button", onclick: () => this.back(), disabled: true }, "Back to now");
    fill(
      box,
      labelled("version", this.slider),
      el("p", {}, "shows ", this.shows),
      el("p", {}, this.play, " ", this.now),
    );
  }

  get newest() {
    return this.store.head?.version ?? 1;
  }

  // The slider follows a map that grows, while it shows the newest state.
  draw() {
    this.slider.min = this.oldest;
    this.slider.max = this.newest;
    if (!this.store.past && !this.playing && this.wanted === null) this.slider.value = this.newest;
    this.slider.setAttribute("aria-valuetext", `version ${this.slider.value} of ${this.newest}`);
  }

  move() {
    this.playing = false;
    this.show(Number(this.slider.value));
  }

  // What is asked for last is shown, however fast the slider moves.
  async show(version) {
    this.wanted = version;
    if (this.isAsking) return;
    this.isAsking = true;
    while (this.wanted !== null) {
      const asked = this.wanted;
      await this.load(asked);
      if (this.wanted === asked) this.wanted = null;
    }
    this.isAsking = false;
    this.draw();
  }

  // Finds out which versions are kept.
  async lookBack() {
    try {
      this.oldest = Math.max(1, (await askPast(this.store.map, { version: this.newest })).oldest);
      this.draw();
    } catch (refused) {
      this.say(refused.message, "bad");
    }
  }

  async load(version) {
    if (version >= this.newest) return this.set(null);
    try {
      const past = pastOf(await askPast(this.store.map, { version }));
      this.oldest = Math.max(1, past.oldest);
      this.set(past);
    } catch (refused) {
      this.playing = false;
      this.say(refused.message, "bad");
    }
  }

  set(past) {
    this.store.showPast(past);
    this.now.disabled = !past;
    fill(this.shows, past ? `version ${past.version} of ${this.newest}, ${past.nodes.size} nodes` : "the newest state");
    // Somebody may have moved it on meanwhile.
    if (past && (this.wanted ?? past.version) === past.version) this.slider.value = past.version;
    fill(this.play, this.playing ? "Stop" : "Play its growth");
  }

  async run() {
    this.playing = true;
    await this.lookBack();
    const last = this.newest;
    const at = Number(this.slider.value);
    const first = at >= last ? this.oldest : at;
    const step = Math.max(1, Math.ceil((last - this.oldest) / STEPS));
    for (let version = first; this.playing && version < last; version += step) {
      const pause = new Promise((done) => setTimeout(done, STEP_MS));
      await this.load(version);
      await pause;
    }
    if (this.playing) this.back();
    this.stop();
  }

  stop() {
    this.playing = false;
    fill(this.play, "Play its growth");
  }

  back() {
    this.playing = false;
    this.wanted = null;
    this.set(null);
    this.draw();
  }

  end() {
    this.playing = false;
  }
}
