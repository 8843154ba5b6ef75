// What stands beside the map: paths, robots, rules, releases, health.

import { ask, change, selector, zenohLine } from "./api.js";
import { el, fill, metres, size, table } from "./dom.js";

function labelled(text, input) {
  return el("label", {}, text, input);
}

function point([x, y]) {
  return `${x.toFixed(3)},${y.toFixed(3)}`;
}

// Start, goal, and the answer.
export class PathPanel {
  constructor(box, map, { found, say }) {
    Object.assign(this, { map, found, say });
    this.from = el("input", { required: true, placeholder: "0,0" });
    this.to = el("input", { required: true, placeholder: "dock" });
    this.answer = el("div", { role: "status" });
    const form = el("form", { onsubmit: (event) => this.submit(event) },
      labelled("from", this.from), labelled("to", this.to), el("button", {}, "Path"));
    fill(box, el("h2", {}, "Path"), form, this.answer);
  }

  submit(event) {
    event.preventDefault();
    this.ask();
  }

  take(ends) {
    this.from.value = point(ends[0]);
    this.to.value = ends[1] ? point(ends[1]) : "";
    if (ends[1]) this.ask();
  }

  async ask() {
    const asked = { from: this.from.value.trim(), to: this.to.value.trim() };
    const begun = performance.now();
    try {
      const path = await ask(this.map, "path", asked);
      const took = performance.now() - begun;
      this.found(path);
      const line = zenohLine(selector(this.map, "path", asked));
      const copy = el("button", { type: "button", onclick: () => this.copy(line) }, "Copy");
      const limits = (path.speed_limits ?? []).map((limit) => `${limit.zone}: ${limit.max_mps} m/s`);
      fill(this.answer,
        el("p", {}, `${metres(path.length_m)}, answered in ${took.toFixed(0)} ms`,
          path.release ? `, on release ${path.release}` : ""),
        path.goal_moved_m ? el("p", { class: "warn" }, `the goal was moved by ${metres(path.goal_moved_m)}`) : null,
        path.unmapped_m ? el("p", { class: "warn" }, `${metres(path.unmapped_m)} over unmapped ground`) : null,
        path.obeyed?.length ? el("p", {}, `obeys ${path.obeyed.map(ruleInWords).join(", ")}`) : null,
        limits.length ? el("p", {}, `slower in ${limits.join(", ")}`) : null,
        el("p", {}, el("code", {}, line), " ", copy));
    } catch (refused) {
      this.found(null);
      fill(this.answer, el("p", { class: "bad" }, refused.message));
    }
  }

  async copy(line) {
    try {
      await navigator.clipboard.writeText(line);
      this.say("copied");
    } catch {
      this.say("this browser does not let pages copy: select the line");
    }
  }
}

function ruleInWords({ rule, zone, edge, robot }) {
  if (rule === "keep_out") return `zone ${zone}`;
  if (rule === "closed_edge") return `closed edge ${edge.join(" ")}`;
  return `what ${robot} found blocked`;
}

export function drawRobots(box, store) {
  const rows = store.fleet.map(({ status, alive, behind, late, seen_s: seen }) => {
    const robot = store.robots.get(status.robot);
    return [
      status.robot, alive ? robot?.state ?? status.state : `away for ${Math.round(seen)} s`,
      [late ? `${behind} behind, late` : behind ? `${behind} behind` : "up to date", late ? "bad" : ""],
      status.release ?? "newest",
    ];
  });
  fill(box, el("h2", {}, "Robots"), table(`${rows.length} heard of`, ["name", "state", "map", "runs"], rows));
}

export function drawHealth(box, store) {
  const head = store.head;
  if (!head) return;
  const shown = `${store.nodes.size} of ${head.main_nodes + head.support_nodes} nodes shown`;
  fill(box, el("h2", {}, "Map"), table("", ["what", "is"], [
    ["version", String(head.version)],
    ["nodes", `${head.main_nodes} main, ${head.support_nodes} support`],
    ["edges", String(head.edges)],
    ["size", size(head.bytes)],
    ["refused increments", [String(head.refused), head.refused ? "warn" : ""]],
    ["robots use", head.enabled ?? "the newest state"],
  ]), store.truncated ? el("p", { class: "warn" }, shown) : null,
  head.read_only ? el("p", { class: "bad" }, "the server's disk takes nothing in") : null,
  head.deletion ? el("p", { class: "bad" }, `will be deleted at ${head.deletion.at}: ${head.deletion.reason}`) : null);
}

// Changes: each is one increment in the operator's name, and undo is another.
export class ChangePanel {
  constructor(box, store, me, { say, done }) {
    Object.assign(this, { box, store, me, say, done, picked: null, journal: [] });
    this.mayChange = me.rights === "change";
    this.form = el("div", {});
    this.list = el("div", {});
    this.releases = el("div", {});
    const undo = el("button", { type: "button", onclick: () => this.send({ op: "undo" }, "undone") }, "Undo my last change");
    fill(box, el("h2", {}, "Places, zones, closures"), this.form, this.list, this.mayChange ? undo : null,
      el("h2", {}, "Releases"), this.releases, this.mayChange ? this.releaseForm() : null, this.notes = el("ul", {}));
  }

  async send(order, words) {
    try {
      const reply = await change(this.store.map, order);
      const said = reply.words ? reply.words.join("; ") : words;
      this.say(`${said}; the map is at version ${reply.version}`);
      this.note(`${new Date().toLocaleTimeString()} ${this.me.name}: ${said}`);
      this.done();
      return true;
    } catch (refused) {
      this.say(refused.message, "bad");
      return false;
    }
  }

  note(text) {
    this.journal = [text, ...this.journal].slice(0, 20);
    fill(this.notes, this.journal.map((line) => el("li", { class: "soft" }, line)));
  }

  take(chosen) {
    if (chosen.kind === "place") this.placeForm(chosen.at);
    else if (chosen.kind === "zone") this.zoneForm(chosen.corners);
    else if (chosen.kind === "edge") this.edgeForm(chosen.edge);
    else if (chosen.kind === "begin") fill(this.form);
  }

  placeForm([x, y]) {
    const name = el("input", { required: true, maxlength: 64 });
    const yaw = el("input", { type: "number", value: "0", min: -360, max: 360 });
    const submit = (event) => {
      event.preventDefault();
      const pose = [x, y, (Number(yaw.value) * Math.PI) / 180];
      this.send({ op: "set_place", name: name.value.trim(), pose }, `place ${name.value.trim()} is named`);
    };
    fill(this.form, el("form", { onsubmit: submit }, labelled("name of the place", name),
      labelled("heading, degrees", yaw), el("button", {}, `Name ${point([x, y])}`)));
    name.focus({ preventScroll: true });
  }

  zoneForm(corners) {
    if (corners.length < 3) {
      fill(this.form, el("p", { class: "soft" }, `${corners.length} corners; a zone has three or more`));
      return;
    }
    const before = this.form.querySelector("input");
    const name = el("input", { required: true, maxlength: 64, value: before?.value ?? "" });
    const speed = el("input", { type: "number", step: "0.1", min: 0, max: 65, placeholder: "keep out" });
    const submit = (event) => {
      event.preventDefault();
      const rule = speed.value ? { speed_limit: Number(speed.value) } : "keep_out";
      this.send({ op: "set_zone", name: name.value.trim(), zone: { rule, corners } }, `zone ${name.value.trim()} is drawn`);
    };
    fill(this.form, el("form", { onsubmit: submit }, labelled("name of the zone", name),
      labelled("at most, m/s", speed), el("button", {}, `Draw ${corners.length} corners`)));
  }

  edgeForm(edge) {
    if (!edge) {
      fill(this.form, el("p", { class: "soft" }, "no edge is near"));
      return;
    }
    const isClosed = this.store.rules.closed_edges.some(([a, b]) => edge.includes(a) && edge.includes(b));
    const does = () => this.send({ op: "set_closed", edge, closed: !isClosed }, isClosed ? "opened" : "closed");
    fill(this.form, el("p", {}, `edge ${edge.join(" – ")} `,
      el("button", { type: "button", onclick: does }, isClosed ? "Open it" : "Close it")));
  }

  releaseForm() {
    const name = el("input", { required: true, maxlength: 64, value: new Date().toISOString().slice(0, 10) + ".1" });
    const submit = (event) => {
      event.preventDefault();
      this.send({ op: "put_release", name: name.value.trim() }, `release ${name.value.trim()} is made`);
    };
    return el("form", { onsubmit: submit }, labelled("name of the release", name), el("button", {}, "Make a release"));
  }

  item(text, action, does) {
    const button = el("button", { type: "button", "aria-label": `${action}: ${text}`, onclick: does }, action);
    return el("li", {}, el("span", {}, text), this.mayChange ? button : null);
  }

  draw() {
    const { places, zones, closed_edges: closed, blocked } = this.store.rules;
    // What is drawn anew loses the focus: only when it is another.
    const now = JSON.stringify([places, zones, closed, blocked.map(({ robot }) => robot), this.store.releases]);
    if (now === this.drawn) return;
    this.drawn = now;
    fill(this.list, el("ul", {},
      places.map(({ name, pose }) => this.item(`place ${name} at ${point(pose)}`, "Remove",
        () => this.send({ op: "set_place", name, pose: null }, `place ${name} is taken away`))),
      zones.map(({ name, rule }) => this.item(`zone ${name}: ${rule === "keep_out" ? "keep out" : `${rule.speed_limit} m/s`}`,
        "Remove", () => this.send({ op: "set_zone", name, zone: null }, `zone ${name} is taken away`))),
      closed.map((edge) => this.item(`closed: ${edge.join(" – ")}`, "Open",
        () => this.send({ op: "set_closed", edge, closed: false }, "opened"))),
      blocked.map(({ robot, for_s: seconds }) => el("li", { class: "warn" },
        `${robot} found its way blocked; for another ${Math.round(seconds)} s`))));
    const isAny = this.store.releases.some((release) => release.enabled);
    fill(this.releases, el("ul", {},
      this.store.releases.map((release) => {
        const id = `${release.name}@${release.author}`;
        const text = `${release.name}, version ${release.version}${release.enabled ? ", in use" : ""}`;
        return release.enabled || !release.available ? el("li", {}, text)
          : this.item(text, "Enable", () => this.send({ op: "enable", release: id }, `robots use ${release.name}`));
      }),
      isAny ? this.item("the newest state", "Enable",
        () => this.send({ op: "enable", release: null }, "robots use the newest state")) : null));
  }
}
