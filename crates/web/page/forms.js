// Forms of changes: each calls `send` with an order and the words for what it does.

import { el, fill, labelled, metres } from "./dom.js";
import { contains, point, readPoints } from "./geometry.js";

const MOST_ERASED = 2000;

function submits(does) {
  return (event) => {
    event.preventDefault();
    does();
  };
}

export function placeForm([x, y], send) {
  const name = el("input", { required: true, maxlength: 64, autocomplete: "off" });
  const [east, north] = [x, y].map((value) =>
    el("input", { type: "number", step: "any", value: value.toFixed(3), class: "short" }),
  );
  const yaw = el("input", { type: "number", value: "0", min: -360, max: 360, step: "any", class: "short" });
  const save = () => {
    const pose = [Number(east.value), Number(north.value), (Number(yaw.value) * Math.PI) / 180];
    send({ op: "set_place", name: name.value.trim(), pose }, `place ${name.value.trim()} is named`);
  };
  const form = el(
    "form",
    { onsubmit: submits(save) },
    labelled("name of the place", name),
    labelled("x, m", east),
    labelled("y, m", north),
    labelled("heading, °", yaw),
    el("button", {}, "Save the place"),
  );
  return { form, first: name };
}

// One form while corners are clicked, dragged and typed.
export class ZoneForm {
  constructor({ send, preview, cornered, previewed }) {
    this.name = el("input", { required: true, maxlength: 64, autocomplete: "off" });
    this.speed = el("input", {
      type: "number",
      step: "any",
      min: 0.001,
      max: 65,
      placeholder: "keep out",
      class: "short",
    });
    this.text = el("textarea", { rows: 4, oninput: () => this.typed(cornered), spellcheck: "false" });
    this.answer = el("div", { role: "status" });
    const save = () => send(this.order(), `zone ${this.order().name} is drawn`);
    const look = async () => {
      fill(this.answer, el("p", { class: "soft" }, "looking …"));
      const shown = await preview(this.order()).then(inWords, (refused) => ({
        said: el("p", { class: "bad" }, refused.message),
        drawn: [],
      }));
      fill(this.answer, shown.said);
      previewed(shown.drawn);
    };
    this.look = el("button", { type: "button", onclick: look }, "What would change?");
    this.save = el("button", {}, "Save the zone");
    this.form = el(
      "form",
      { onsubmit: submits(save) },
      labelled("name of the zone", this.name),
      labelled("at most, m/s", this.speed),
      labelled("corners, x,y each", this.text),
      this.look,
      this.save,
      this.answer,
    );
    this.set([]);
  }

  // Another zone's, or none.
  begin({ name = "", rule = "keep_out", corners = [] } = {}) {
    this.name.value = name;
    this.speed.value = rule.speed_limit ?? "";
    fill(this.answer);
    this.set(corners);
  }

  set(corners) {
    this.corners = corners;
    this.text.value = corners.map((corner) => point(corner)).join("\n");
    this.check();
  }

  typed(cornered) {
    const corners = readPoints(this.text.value);
    if (corners) {
      this.corners = corners;
      cornered(corners);
    }
    this.check(corners);
  }

  check(corners = this.corners) {
    const isZone = (corners?.length ?? 0) >= 3;
    this.save.disabled = this.look.disabled = !isZone;
    this.text.setCustomValidity(isZone ? "" : "three corners or more, each x,y on a line of its own");
  }

  order() {
    const rule = this.speed.value ? { speed_limit: Number(this.speed.value) } : "keep_out";
    return { op: "set_zone", name: this.name.value.trim() || "zone", zone: { rule, corners: this.corners } };
  }
}

// What a preview says: paths between places before and after, in words and as lines.
function inWords({ paths, asked }) {
  const line = ({ from, to, before_m: before, after_m: after, message }) => {
    if (after === undefined)
      return el("li", { class: "bad" }, `${from} – ${to}: ${metres(before)}, then none: ${message}`);
    if (before === undefined) return el("li", { class: "good" }, `${from} – ${to}: none so far, then ${metres(after)}`);
    return el("li", {}, `${from} – ${to}: ${metres(before)}, then ${metres(after)}`);
  };
  const drawn = paths.map(({ before, after }) => ({ before, after }));
  const said =
    asked === 0
      ? el("p", { class: "soft" }, "no two places are named: there is no path to compare")
      : paths.length === 0
        ? el("p", { class: "good" }, `none of ${asked} paths between places would change`)
        : el(
            "div",
            {},
            el("p", { class: "warn" }, `${paths.length} of ${asked} paths between places would change:`),
            el("ul", {}, paths.map(line)),
          );
  return { said, drawn };
}

export function edgeForm(edge, isClosed, send) {
  if (!edge) return el("p", { class: "soft" }, "no edge is near");
  const does = () =>
    send({ op: "set_closed", edge, closed: !isClosed }, isClosed ? "the edge is open" : "the edge is closed");
  return el(
    "p",
    {},
    `edge ${edge.join(" – ")} `,
    el("button", { type: "button", onclick: does }, isClosed ? "Open it" : "Close it"),
  );
}

export function eraseForm(corners, nodes, send) {
  if (corners.length < 3) return el("p", { class: "soft" }, `${corners.length} corners; a part has three or more`);
  const inside = [...nodes.values()].filter(({ x, y }) => contains(corners, [x, y])).map(({ id }) => id);
  if (!inside.length) return el("p", { class: "soft" }, "no node lies in it");
  if (inside.length > MOST_ERASED)
    return el("p", { class: "bad" }, `${inside.length} nodes lie in it; at most ${MOST_ERASED} go at a time`);
  const does = () => send({ op: "remove_nodes", nodes: inside }, `${inside.length} nodes are erased`);
  return el("p", {}, el("button", { type: "button", class: "danger", onclick: does }, `Erase ${inside.length} nodes`));
}
