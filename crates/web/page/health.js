// How the server is: what it was asked and how long that took, what was refused, what it stores.
// All of it from the figures that Prometheus reads.

import { askFigures, askWarnings } from "./api.js";
import { el, fill, section, size, table } from "./dom.js";
import { buckets, byLabel, figure, quantile, readFigures } from "./figures.js";
import { Live } from "./live.js";

const EVERY_MS = 2000;
const WINDOW = 30; // looks back so many readings

export function showHealth(main) {
  const boxes = Object.fromEntries(
    ["server", "questions", "times", "maps", "page", "log"].map((name) => [name, el("div", {})]),
  );
  const notice = el("p", { role: "status" });
  fill(
    main,
    el(
      "section",
      { class: "page" },
      el("h1", {}, "Health"),
      notice,
      section("Server", true, boxes.server),
      section("Questions since this page was opened, or in the last minute", true, boxes.questions),
      section("How long answers took", true, boxes.times),
      section("Maps", true, boxes.maps),
      section("This page", true, boxes.page),
      section("Last warnings of the log", true, boxes.log),
    ),
  );
  const readings = [];

  async function look() {
    try {
      const now = { at: performance.now(), figures: readFigures(await askFigures()) };
      // A server that was started anew counts anew.
      if (readings.length && hasFallen(readings.at(-1).figures, now.figures)) readings.length = 0;
      readings.push(now);
      if (readings.length > WINDOW) readings.shift();
      draw(readings[0], readings.at(-1), boxes);
      drawLog(boxes.log, (await askWarnings()).lines);
      fill(notice);
    } catch (refused) {
      notice.className = "bad";
      fill(notice, refused.message);
    }
  }

  // It tells whether the server is there.
  const live = new Live("/api/events", {}, look);
  const timer = setInterval(look, EVERY_MS);
  return () => {
    live.end();
    clearInterval(timer);
  };
}

// Whether a count of questions is less than it was.
function hasFallen(before, now) {
  const counts = before.filter(({ name }) => name === "fht_queries_total");
  return counts.some(({ name, labels, value }) => figure(now, name, labels) < value);
}

const number = (text) => [text, "number"];
const time = (seconds) =>
  seconds === null
    ? "–"
    : seconds === Infinity
      ? "over 10 s"
      : seconds < 1
        ? `${Number((seconds * 1000).toFixed(1))} ms`
        : `${seconds} s`;

function draw(first, last, boxes) {
  const seconds = Math.max((last.at - first.at) / 1000, 0.001);
  const sum = (of, name) => of.figures.filter((one) => one.name === name).reduce((total, one) => total + one.value, 0);
  const rate = (name) => Math.max(0, sum(last, name) - sum(first, name)) / seconds;
  const now = last.figures;
  const isReadOnly = figure(now, "fht_server_read_only") > 0;
  fill(
    boxes.server,
    table(
      "",
      ["figure", "value"],
      [
        ["takes in what is written", isReadOnly ? ["no: its disk takes nothing", "bad"] : ["yes", "good"]],
        ["increments a second", rate("fht_map_version").toFixed(2)],
        ["increments refused", warned(sum(last, "fht_map_refused_increments_total"))],
        ["robots there, late", `${sum(last, "fht_map_robots")}, ${sum(last, "fht_map_late_robots")} late`],
        ["Zenoh sessions", sessions(now)],
        ["size of all maps", size(sum(last, "fht_map_size_bytes"))],
        ...optional(now, "fht_server_disk_free_bytes", "room left on the disk", size),
        ["warnings, errors in the log", warned(sum(last, "fht_log_lines_total"))],
      ],
    ),
  );
  drawQuestions(boxes, first.figures, now, seconds);
  const version = byLabel(now, "fht_map_version", "map");
  fill(
    boxes.maps,
    table(
      "",
      ["map", number("version"), number("size"), number("robots"), number("refused")],
      [...version].map(([map, value]) => [
        el("a", { href: `#/${encodeURIComponent(map)}` }, map),
        number(String(value)),
        number(size(figure(now, "fht_map_size_bytes", { map }))),
        number(String(figure(now, "fht_map_robots", { map }))),
        number(String(figure(now, "fht_map_refused_increments_total", { map }))),
      ]),
    ),
  );
  fill(
    boxes.page,
    table(
      "",
      ["figure", "value"],
      [
        ["connections", String(figure(now, "fht_http_connections"))],
        ["streams of events", String(figure(now, "fht_http_event_streams"))],
        ["connections refused for want of room", warned(figure(now, "fht_http_refused_connections_total"))],
        ["requests a second", rate("fht_http_requests_total").toFixed(1)],
      ],
    ),
  );
}

function drawLog(box, lines) {
  const at = (line) => new Date(line.at_us / 1000).toLocaleString();
  fill(
    box,
    lines.length
      ? table(
          "",
          ["when", "what"],
          lines.map((line) => [at(line), [line.text, line.is_error ? "bad" : "warn"]]),
        )
      : el("p", { class: "soft" }, "none"),
  );
}

// Whoever is connected to the server itself.
function sessions(figures) {
  const kinds = [...byLabel(figures, "fht_zenoh_sessions", "kind")].filter(([, count]) => count);
  return kinds.map(([kind, count]) => `${count} ${kind}${count === 1 ? "" : "s"}`).join(", ") || "none";
}

const warned = (count) => [String(count), count ? "warn" : ""];

function optional(figures, name, words, shown) {
  const found = figures.find((of) => of.name === name);
  return found ? [[words, shown(found.value)]] : [];
}

function drawQuestions(boxes, before, now, seconds) {
  const topics = [...new Set(now.filter(({ name }) => name === "fht_queries_total").map(({ labels }) => labels.topic))];
  const rows = topics
    .map((topic) => {
      const counted = (figures) => buckets(figures, "fht_query_duration_seconds", { topic });
      const was = counted(before);
      const all = counted(now);
      const lately = all.map(({ upto, count }, index) => ({ upto, count: count - (was[index]?.count ?? 0) }));
      const count = (figures, outcome) => figure(figures, "fht_queries_total", { topic, outcome });
      const of = (outcome) => count(now, outcome) - count(before, outcome);
      const asked = lately.reduce((sum, { count }) => sum + count, 0);
      return { topic, of, lately, all, asked };
    })
    .filter(({ all }) => all.some(({ count }) => count));
  const titles = [
    "question",
    number("a second"),
    number("half within"),
    number("99 % within"),
    number("answered"),
    number("refused"),
    number("busy"),
  ];
  fill(
    boxes.questions,
    table(
      "",
      titles,
      rows.map(({ topic, of, lately, asked }) => [
        topic,
        number((asked / seconds).toFixed(1)),
        number(time(quantile(lately, 0.5))),
        number(time(quantile(lately, 0.99))),
        number(String(of("answered"))),
        number(String(of("refused"))),
        number(String(of("busy"))),
      ]),
    ),
  );
  const total = new Map();
  for (const { all } of rows) for (const { upto, count } of all) total.set(upto, (total.get(upto) ?? 0) + count);
  const most = Math.max(...total.values(), 1);
  fill(
    boxes.times,
    table(
      "all questions since the server started",
      ["within", number("questions"), "share"],
      [...total].map(([upto, count]) => [
        time(upto),
        number(String(count)),
        el("progress", { max: most, value: count, "aria-label": `${count} questions within ${time(upto)}` }),
      ]),
    ),
  );
}
