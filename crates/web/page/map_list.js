// The list of maps.

import { ask, askMaps } from "./api.js";
import { el, fill, size, table } from "./dom.js";
import { Live } from "./live.js";

const ROBOTS_EVERY_MS = 5000;
const ALL_EVERY_MS = 15000; // no event tells that a map has gone
const MOST_ASKED = 20; // robots are asked for of so many maps

export function showList(main) {
  const heads = new Map();
  const robots = new Map();
  const search = el("input", { type: "search", id: "search", oninput: () => draw() });
  const list = el("div", { "aria-live": "off" });
  const notice = el("p", { role: "status" });
  fill(main, el("section", { class: "page" },
    el("h1", {}, "Maps"),
    el("p", {}, el("label", { for: "search" }, "Search "), search), notice, list));

  function shown() {
    const wanted = search.value.toLowerCase();
    return [...heads.values()].filter((head) => head.map.toLowerCase().includes(wanted));
  }

  function draw() {
    const rows = shown().map((head) => {
      const here = (robots.get(head.map) ?? []).filter((robot) => robot.alive);
      const explorers = here.filter((robot) => robot.status.role === "explorer").map((robot) => robot.status.robot);
      const state = head.damaged ? "damaged" : head.deletion ? "will be deleted" : head.read_only ? "read only" : "";
      return [
        el("a", { href: `#/${encodeURIComponent(head.map)}` }, head.map),
        [String(head.version), "number"],
        [String(head.main_nodes + head.support_nodes), "number"],
        [size(head.bytes), "number"],
        head.enabled ?? "newest state",
        [String(here.length), "number"],
        explorers.join(", "),
        [state, "bad"],
      ];
    });
    const number = (text) => [text, "number"];
    const titles = ["map", number("version"), number("nodes"), number("size"), "robots use", number("robots"), "explored by", ""];
    fill(list, table(`${rows.length} of ${heads.size} maps`, titles, rows));
  }

  async function load() {
    try {
      const reply = await askMaps();
      heads.clear();
      for (const head of reply.maps) heads.set(head.map, head);
      notice.textContent = reply.read_only ? `nothing is taken in: ${reply.read_only}` : reply.warning ?? "";
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
  const timers = [
    setInterval(() => askRobots().catch(() => {}), ROBOTS_EVERY_MS),
    setInterval(load, ALL_EVERY_MS),
  ];
  return () => {
    live.end();
    timers.forEach(clearInterval);
  };
}
