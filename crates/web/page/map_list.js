// The list of maps.

import { ask, askMaps } from "./api.js";
import { el, fill, inUse, size, table } from "./dom.js";
import { Live } from "./live.js";

const ROBOTS_EVERY_MS = 5000;
const ALL_EVERY_MS = 15000; // no event tells that a map has gone
const MOST_ASKED = 20; // robots are asked for of so many maps

export function showList(main) {
  const heads = new Map();
  const robots = new Map();
  const search = el("input", { type: "search", id: "search", oninput: () => draw(), autocomplete: "off" });
  const count = el("p", { class: "soft", role: "status" });
  const list = el("div", {});
  const notice = el("p", { role: "status" });
  fill(
    main,
    el(
      "section",
      { class: "page" },
      el("h1", {}, "Maps"),
      el("p", {}, el("label", { for: "search" }, "Search "), search),
      notice,
      count,
      list,
    ),
  );

  function shown() {
    const wanted = search.value.trim().toLowerCase();
    return [...heads.values()]
      .filter((head) => head.map.toLowerCase().includes(wanted))
      .sort((a, b) => (a.map < b.map ? -1 : 1));
  }

  const columns = [
    ["map", (head) => head.map],
    [["version", "number"], (head) => [String(head.version), "number"]],
    [["nodes", "number"], (head) => [String(head.main_nodes + head.support_nodes), "number"]],
    [["size", "number"], (head) => [size(head.bytes), "number"]],
    ["robots use", (head) => inUse({ ...head, enabled: head.enabled?.split("@")[0] })],
    [["robots", "number"], (head) => [String(here(head).length), "number"]],
    [
      "explored now by",
      (head) =>
        here(head)
          .filter((robot) => robot.status.role === "explorer")
          .map((robot) => robot.status.robot)
          .join(", "),
    ],
    [
      "notes",
      (head) => [
        head.damaged ? "damaged" : head.deletion ? "will be deleted" : head.read_only ? "read only" : "",
        "bad",
      ],
    ],
  ];
  const here = (head) => (robots.get(head.map) ?? []).filter((robot) => robot.alive);

  function draw() {
    const found = shown();
    const rows = found.map((head) => columns.map(([, cell]) => cell(head)));
    const now = JSON.stringify(rows);
    fill(count, `${found.length} of ${heads.size} maps`);
    if (now === draw.drawn) return;
    draw.drawn = now;
    // The link that had the focus keeps it.
    const focused = list.contains(document.activeElement) ? document.activeElement.textContent : null;
    for (const row of rows) row[0] = el("a", { href: `#/${encodeURIComponent(row[0])}` }, row[0]);
    fill(
      list,
      heads.size
        ? table(
            "",
            columns.map(([title]) => title),
            rows,
          )
        : el("p", {}, "There is no map yet: the first explorer begins one (mapper explore)."),
    );
    [...list.querySelectorAll("a")].find((link) => link.textContent === focused)?.focus();
  }

  async function load() {
    try {
      const reply = await askMaps();
      heads.clear();
      for (const head of reply.maps) heads.set(head.map, head);
      notice.textContent = reply.read_only ? `nothing is taken in: ${reply.read_only}` : (reply.warning ?? "");
      notice.className = reply.read_only ? "bad" : "warn";
      draw();
      await askRobots();
    } catch (refused) {
      notice.textContent = refused.message;
      notice.className = "bad";
    }
  }

  async function askRobots() {
    for (const head of shown().slice(0, MOST_ASKED)) {
      const fleet = await ask(head.map, "fleet", { limit: 1000 }).catch(() => null);
      if (fleet) robots.set(head.map, fleet.robots);
    }
    draw();
  }

  const onHead = (head) => {
    heads.set(head.map, head);
    draw();
  };
  const live = new Live("/api/events", { head: onHead }, load);
  const timers = [setInterval(() => askRobots().catch(() => {}), ROBOTS_EVERY_MS), setInterval(load, ALL_EVERY_MS)];
  return () => {
    live.end();
    timers.forEach(clearInterval);
  };
}
