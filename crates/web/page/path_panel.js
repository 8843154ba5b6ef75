// A path: start, goal, the answer, and the line that asks the same over Zenoh.

import { ask, selector, zenohLine } from "./api.js";
import { copyButton, el, fill, labelled, metres } from "./dom.js";
import { point } from "./geometry.js";

export class PathPanel {
  constructor(box, store, me, { found, say }) {
    Object.assign(this, { store, me, found, say });
    this.from = el("input", { required: true, placeholder: "0,0", list: "ends" });
    this.to = el("input", { required: true, placeholder: "dock", list: "ends" });
    this.ends = el("datalist", { id: "ends" });
    this.answer = el("div", { role: "status" });
    const form = el(
      "form",
      { onsubmit: (event) => this.submit(event) },
      labelled("from", this.from),
      labelled("to", this.to),
      el("button", {}, "Find the path"),
      this.ends,
    );
    fill(box, form, el("p", { class: "soft" }, "x,y in metres, a node, a place or a robot"), this.answer);
  }

  submit(event) {
    event.preventDefault();
    this.ask();
  }

  take(ends) {
    this.from.value = point(ends[0]);
    this.to.value = ends[1] ? point(ends[1]) : "";
    fill(this.answer);
    if (ends[1]) this.ask();
  }

  // Places and robots that may be typed.
  draw() {
    const names = [...this.store.rules.places.map(({ name }) => name), ...this.store.robots.keys()];
    const now = names.join("\n");
    if (now !== this.drawn)
      fill(
        this.ends,
        names.slice(0, 200).map((value) => el("option", { value })),
      );
    this.drawn = now;
  }

  // A robot is where it stands now; everything else the server understands.
  end(text) {
    const pose = this.store.robots.get(text)?.map_from_base;
    return pose && !this.store.rules.places.some(({ name }) => name === text) ? point(pose) : text;
  }

  async ask() {
    const asked = { from: this.end(this.from.value.trim()), to: this.end(this.to.value.trim()) };
    const begun = performance.now();
    try {
      const path = await ask(this.store.map, "path", asked);
      this.show(path, performance.now() - begun, zenohLine(selector(this.store.map, "path", asked), this.me.zenoh));
    } catch (refused) {
      this.found(null);
      fill(this.answer, el("p", { class: "bad" }, refused.message));
    }
  }

  show(path, took, line) {
    this.found(path);
    const limits = (path.speed_limits ?? []).map((limit) => `${limit.zone}: ${limit.max_mps} m/s`);
    fill(
      this.answer,
      el(
        "p",
        {},
        el("strong", {}, metres(path.length_m)),
        `, answered in ${took.toFixed(0)} ms`,
        path.release ? `, on release ${path.release}` : "",
      ),
      path.goal_moved_m ? el("p", { class: "warn" }, `the goal was moved by ${metres(path.goal_moved_m)}`) : null,
      path.unmapped_m ? el("p", { class: "warn" }, `${metres(path.unmapped_m)} over unmapped ground`) : null,
      path.obeyed?.length ? el("p", {}, `obeys ${path.obeyed.map(ruleInWords).join(", ")}`) : null,
      limits.length ? el("p", {}, `slower in ${limits.join(", ")}`) : null,
      el("div", { class: "line" }, el("code", {}, line), copyButton(line, this.say)),
    );
  }
}

function ruleInWords({ rule, zone, edge, robot }) {
  if (rule === "keep_out") return `zone ${zone}`;
  if (rule === "closed_edge") return `closed edge ${edge.join(" ")}`;
  return `what ${robot} found blocked`;
}
