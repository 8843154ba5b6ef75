// The robots on a map, and the map in figures.

import { el, fill, inUse, size, table } from "./dom.js";

const MOST_ROBOTS = 100;

function fillIfNew(box, key, make) {
  const now = JSON.stringify(key);
  if (box.drawn === now) return;
  box.drawn = now;
  fill(box, make());
}

export function drawRobots(box, store, showAt) {
  // Those that need a look first.
  const worth = ({ late, alive }) => (late && alive ? 0 : alive ? 1 : 2);
  const fleet = [...store.fleet].sort((a, b) => worth(a) - worth(b)).slice(0, MOST_ROBOTS);
  const rows = fleet.map(({ status, alive, behind, late, seen_s: seen }) => ({
    name: status.robot,
    isThere:
      alive &&
      Boolean(store.robots.get(status.robot)?.map_from_base ?? store.robots.get(status.robot)?.candidates?.length),
    state:
      (status.role === "explorer" && alive ? "explores, " : "") +
      (alive
        ? stateOf(store.robots.get(status.robot) ?? status) + sentTo(store.goals.get(status.robot))
        : `away for ${ago(seen)}`),
    has: late ? `${behind} behind, late` : behind ? `${behind} behind` : "up to date",
    late: late && alive,
    runs: status.release ?? "newest",
  }));
  const find = (name) => {
    const robot = store.robots.get(name);
    const at = robot?.map_from_base ?? robot?.candidates?.[0];
    if (at) showAt(at);
  };
  fillIfNew(box, [rows, store.fleet.length], () =>
    rows.length
      ? table(
          `${store.fleet.filter(({ alive }) => alive).length} here, ${store.fleet.length} heard of`,
          ["name", "state", "map", "runs"],
          rows.map((row) => [
            row.isThere
              ? el(
                  "button",
                  { type: "button", class: "plain", title: "show it", onclick: () => find(row.name) },
                  row.name,
                )
              : row.name,
            row.state,
            [row.has, row.late ? "bad" : ""],
            row.runs,
          ]),
        )
      : el("p", { class: "soft" }, "none was heard of"),
  );
}

function stateOf({ state, candidates = [], probabilities = [], confidence = 0, lost_because: why }) {
  const percent = (share) => `${Math.round(100 * share)} %`;
  if (probabilities.length > 1) return `${candidates.length} candidates: ${probabilities.map(percent).join(", ")}`;
  if (candidates.length) return `${candidates.length} candidates, the likeliest ${percent(confidence)}`;
  return why ? `${state}: ${why}` : state;
}

function sentTo(goal) {
  if (!goal || goal.state === "IDLE") return "";
  if (goal.state === "DRIVING") return `, drives: ${(goal.to_go_m ?? 0).toFixed(0)} m to go`;
  return goal.reason ? `, ${goal.state.toLowerCase()}: ${goal.reason}` : `, ${goal.state.toLowerCase()}`;
}

function ago(seconds) {
  if (seconds < 60) return "less than a minute";
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

export function drawAbout(box, store) {
  const { head, nodes, truncated } = store;
  if (!head) return;
  const key = [head.version, head.refused, head.read_only, head.deletion, inUse(head), truncated, nodes.size];
  fillIfNew(box, key, () =>
    el(
      "div",
      {},
      table(
        "",
        ["figure", "value"],
        [
          ["version", String(head.version)],
          ["nodes", `${head.main_nodes} main, ${head.support_nodes} support`],
          ["edges", String(head.edges)],
          ["size", size(head.bytes)],
          ["refused increments", [String(head.refused), head.refused ? "warn" : ""]],
          ["robots use", inUse(head)],
        ],
      ),
      truncated ? el("p", { class: "warn" }, `the ${nodes.size} nodes nearest to where you look are shown`) : null,
      head.read_only ? el("p", { class: "bad" }, "the server's disk takes nothing in") : null,
      head.deletion
        ? el("p", { class: "bad" }, `will be deleted at ${head.deletion.at}: ${head.deletion.reason}`)
        : null,
    ),
  );
}
