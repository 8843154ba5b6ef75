// What operators have written: places, zones, closures. Each change is one increment in the
// operator's name, and undo is another.

import { change, preview } from "./api.js";
import { el, fill } from "./dom.js";
import { ZoneForm, edgeForm, eraseForm, placeForm } from "./forms.js";
import { point } from "./geometry.js";

export class ChangePanel {
  constructor(box, store, me, { say, done, tools, look }) {
    Object.assign(this, { store, me, say, done, look, tools });
    this.mayChange = me.rights === "change";
    const send = (order, words) => this.send(order, words);
    this.zone = new ZoneForm({
      send,
      preview: (order) => preview(store.map, order),
      cornered: (corners) => tools().setCorners(corners),
      previewed: (drawn) => {
        tools().overlay.preview = drawn;
        tools().changed();
      },
    });
    this.form = el("div", {});
    this.list = el("div", {});
    const undo = el("button", { type: "button", onclick: () => send({ op: "undo" }, "undone") }, "Undo my last change");
    fill(box, this.form, this.list, this.mayChange ? undo : null);
  }

  async send(order, words) {
    const shown = this.form.firstChild;
    this.allTheSame?.remove();
    try {
      const reply = await change(this.store.map, order);
      const said = reply.words ? reply.words.join("; ") : words;
      this.say(`${said}; the map is at version ${reply.version}`);
      // Who was quick has begun the next one meanwhile.
      if (this.form.firstChild === shown) {
        this.done();
        fill(this.form);
      }
      this.store.loadJournal().catch(() => {});
      return true;
    } catch (refused) {
      this.say(refused.message, "bad");
      if (refused.message.includes("; with force")) {
        const force = () => this.send({ ...order, force: true }, words);
        this.allTheSame = el("button", { type: "button", onclick: force }, "Write it all the same");
        this.form.append(this.allTheSame);
      }
      return false;
    }
  }

  // What a click has come to.
  take({ kind, tool, at, corners, edge }) {
    const send = (order, words) => this.send(order, words);
    if (kind === "begin" && tool === "zone") {
      this.zone.begin();
      fill(this.form, this.zone.form);
    } else if (kind === "begin" && tool === "place") {
      // By keyboard a place is typed.
      fill(this.form, placeForm(this.look(), send).form);
    } else if (kind === "begin") {
      fill(this.form);
    } else if (kind === "place") {
      const { form, first } = placeForm(at, send);
      fill(this.form, form);
      first.focus({ preventScroll: true });
    } else if (kind === "zone") {
      // The next one, after one was saved.
      if (!this.zone.form.isConnected) {
        this.zone.begin();
        fill(this.form, this.zone.form);
      }
      this.zone.set(corners);
    } else if (kind === "erase") {
      fill(this.form, eraseForm(corners, this.store.nodes, send));
    } else if (kind === "edge") {
      const isClosed = edge && this.store.rules.closed_edges.some(([a, b]) => edge.includes(a) && edge.includes(b));
      fill(this.form, edgeForm(edge, isClosed, send));
    }
  }

  edit(zone) {
    this.tools().use("zone");
    this.zone.begin(zone);
    this.tools().setCorners(zone.corners);
    this.zone.name.focus({ preventScroll: true });
  }

  item(text, ...actions) {
    const button = ([action, does]) =>
      el("button", { type: "button", "aria-label": `${action}: ${text}`, onclick: does }, action);
    return el(
      "li",
      {},
      el("span", {}, text),
      this.mayChange ? el("span", { class: "actions" }, actions.map(button)) : null,
    );
  }

  draw() {
    const { places, zones, closed_edges: closed, blocked } = this.store.rules;
    // What is drawn anew loses the focus: only when it is another.
    const now = JSON.stringify([places, zones, closed, blocked.map(({ robot }) => robot)]);
    if (now === this.drawn) return;
    this.drawn = now;
    const remove = (op, field, name) => [
      "Remove",
      () => this.send({ op, name, [field]: null }, `${field === "pose" ? "place" : "zone"} ${name} is taken away`),
    ];
    const rule = (of) => (of === "keep_out" ? "keep out" : `${of.speed_limit} m/s at most`);
    const none = places.length + zones.length + closed.length + blocked.length === 0;
    fill(
      this.list,
      none
        ? el("p", { class: "soft" }, "none")
        : el(
            "ul",
            {},
            places.map(({ name, pose }) =>
              this.item(`place ${name} at ${point(pose, 2)}`, remove("set_place", "pose", name)),
            ),
            zones.map((zone) =>
              this.item(
                `zone ${zone.name}: ${rule(zone.rule)}`,
                ["Edit", () => this.edit(zone)],
                remove("set_zone", "zone", zone.name),
              ),
            ),
            closed.map((edge) =>
              this.item(`closed: ${edge.join(" – ")}`, [
                "Open",
                () => this.send({ op: "set_closed", edge, closed: false }, "the edge is open"),
              ]),
            ),
            blocked.map(({ robot, for_s: seconds }) =>
              el("li", { class: "warn" }, `${robot} found its way blocked; for another ${Math.round(seconds)} s`),
            ),
          ),
    );
  }
}
