// The page's modules that need no browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Refused, selector, zenohLine } from "../../page/api.js";
import { compare, inWords } from "../../page/compare.js";
import { buckets, byLabel, figure, quantile, readFigures } from "../../page/figures.js";
import { contains, lengthOf, locate, nearest, readPoints, toLine } from "../../page/geometry.js";
import { edgesOf, pastOf } from "../../page/map_store.js";
import { View } from "../../page/view.js";

test("lengths and distances are metres", () => {
  assert.equal(
    lengthOf([
      [0, 0],
      [3, 4],
      [3, 5],
    ]),
    6,
  );
  assert.equal(lengthOf([[1, 1]]), 0);
  assert.equal(toLine([5, 2], [0, 0], [10, 0]), 2);
  assert.equal(toLine([-3, 4], [0, 0], [10, 0]), 5, "beyond an end it is the end that counts");
  assert.equal(toLine([3, 4], [0, 0], [0, 0]), 5, "a line without length is a point");
  assert.equal(
    nearest([5, 2, 9], (far) => far, 3),
    2,
  );
  assert.equal(
    nearest([5], (far) => far, 3),
    null,
  );
});

test("what lies in a polygon is decided by the even-odd rule", () => {
  const house = [
    [0, 0],
    [4, 0],
    [4, 3],
    [2, 5],
    [0, 3],
  ];
  assert.ok(contains(house, [2, 4.5]));
  assert.ok(!contains(house, [0.5, 4.5]));
  const twice = [
    [0, 0],
    [3, 0],
    [3, 3],
    [0, 3],
    [0, 0],
    [1, 1],
    [2, 1],
    [2, 2],
    [1, 2],
    [1, 1],
  ];
  assert.ok(contains(twice, [0.5, 0.5]) && !contains(twice, [1.5, 1.5]), "a hole");
});

test("points of the map are somewhere on earth", () => {
  // A degree at 45° is 111 131.8 m north, and 78 846.8 m east.
  const near = ([latitude, longitude], [north, east]) => {
    assert.ok(Math.abs(latitude - north) < 1e-8 && Math.abs(longitude - east) < 1e-8, `${latitude} ${longitude}`);
  };
  near(locate({ latitude: 45, longitude: 9, yaw: 0 }, [78.8468, 111.1318]), [45.001, 9.001]);
  near(locate({ latitude: 45, longitude: 179.9999, yaw: 0 }, [78.8468, 0]), [45, -179.9991]);
  near(locate({ latitude: 45, longitude: 9, yaw: Math.PI / 2 }, [111.1318, 0]), [45.001, 9]);
});

test("corners are read as people type them", () => {
  assert.deepEqual(readPoints("1,2\n 3.5 ; -4\n\n5 6"), [
    [1, 2],
    [3.5, -4],
    [5, 6],
  ]);
  assert.equal(readPoints("1,2\n3"), null);
  assert.equal(readPoints("1,x"), null);
  assert.deepEqual(readPoints(""), []);
});

test("two states of a map differ by what was added, has gone and has moved", () => {
  const node = (id, x) => [id, { id, x, y: 0 }];
  const before = new Map([node("a", 0), node("b", 1), node("c", 2)]);
  const now = new Map([node("a", 0), node("b", 1.25), node("d", 3)]);
  const found = compare(before, now);
  assert.deepEqual(
    [found.added, found.gone].map((nodes) => nodes.map(({ id }) => id)),
    [["d"], ["c"]],
  );
  assert.equal(inWords(found), "1 node added, 1 node gone, 1 node moved by up to 0.25 m");
  assert.equal(inWords(compare(now, now)), "no node is another");
});

test("each edge comes once, and those that lead to nothing known never", () => {
  const nodes = [
    { id: "a", neighbours: ["b", "z"] },
    { id: "b", neighbours: ["a"] },
  ];
  const past = pastOf({ version: 3, nodes, places: [], zones: [], closed_edges: [], points: [1, 2], oldest: 1 });
  assert.deepEqual(
    [...edgesOf(past.nodes)].map(([one, other]) => one.id + other.id),
    ["ab"],
  );
  assert.deepEqual(past.walls, [1, 2]);
});

test("figures are read as Prometheus does", () => {
  const figures = readFigures(`# HELP fht_map_version Increments.
# TYPE fht_map_version gauge
fht_map_version{map="museum"} 17
fht_map_version{map="lab"} 3
fht_server_read_only 0
fht_query_duration_seconds_bucket{topic="path",le="0.001"} 8
fht_query_duration_seconds_bucket{topic="path",le="0.01"} 9
fht_query_duration_seconds_bucket{topic="path",le="+Inf"} 10
# EOF
`);
  assert.equal(figure(figures, "fht_map_version", { map: "lab" }), 3);
  assert.equal(figure(figures, "fht_nothing"), 0);
  assert.deepEqual(
    [...byLabel(figures, "fht_map_version", "map")],
    [
      ["museum", 17],
      ["lab", 3],
    ],
  );
  const counted = buckets(figures, "fht_query_duration_seconds", { topic: "path" });
  assert.deepEqual(
    counted.map(({ count }) => count),
    [8, 1, 1],
  );
  assert.deepEqual(
    [0.5, 0.9, 0.99].map((share) => quantile(counted, share)),
    [0.001, 0.01, Infinity],
  );
  assert.equal(quantile([], 0.5), null);
});

test("the line to copy asks the same, whatever the names and wherever the server listens", () => {
  const asked = selector("museum", "path", { from: "0,0", to: "Küche" });
  assert.equal(asked, "fht/museum/path?from=0,0;to=Küche");
  assert.equal(
    zenohLine(asked, "tcp/0.0.0.0:7450", "maps.example"),
    "zenoh --connect tcp/maps.example:7450 get -s 'fht/museum/path?from=0,0;to=Küche' --decoder json",
  );
  assert.ok(zenohLine(asked, "tls/10.0.0.5:7447", "maps.example").includes("tls/10.0.0.5:7447"));
  assert.ok(
    zenohLine("a'; rm -rf ~", "tcp/127.0.0.1:7447", "x").includes("'a'\\''; rm -rf ~'"),
    "a quote ends no quotes",
  );
  assert.equal(new Refused(404, "UNKNOWN_MAP", "no").message, "no");
});

function view() {
  globalThis.ResizeObserver = class {
    observe() {}
  };
  globalThis.devicePixelRatio = 2;
  const canvas = {
    clientWidth: 800,
    clientHeight: 600,
    addEventListener() {},
    setPointerCapture() {},
    getBoundingClientRect: () => ({ left: 10, top: 20 }),
  };
  const seen = { clicked: [], grabbed: null };
  const made = new View(canvas, {
    moved() {},
    pointed() {},
    clicked: (at) => seen.clicked.push(at),
    grabbed: () => seen.grabbed,
  });
  return { made, seen, canvas };
}

test("pixels and metres are turned into each other, y up", () => {
  const { made, canvas } = view();
  assert.equal(canvas.width, 1600);
  made.fit([-10, -5, 10, 5]);
  assert.deepEqual(made.toPixels(0, 0), [400, 300]);
  assert.ok(made.toPixels(0, 1)[1] < 300);
  const [x, y] = made.toMetres(...made.toPixels(3.25, -1.5));
  assert.ok(Math.abs(x - 3.25) < 1e-9 && Math.abs(y + 1.5) < 1e-9);
  const before = made.toMetres(100, 100);
  made.zoom(2, [100, 100]);
  const after = made.toMetres(100, 100);
  assert.ok(Math.hypot(before[0] - after[0], before[1] - after[1]) < 1e-9, "what is there stays there");
  for (let times = 0; times < 100; times += 1) made.zoom(2);
  assert.ok(made.scale <= 2000);
});

test("a press is a click, a drag moves the map or what was grabbed, two fingers zoom", () => {
  const { made, seen } = view();
  const event = (pointerId, x, y) => ({ pointerId, clientX: x + 10, clientY: y + 20, button: 0, pointerType: "mouse" });
  made.down(event(1, 400, 300));
  made.up(event(1, 400, 300));
  assert.deepEqual(seen.clicked, [[0, 0]]);
  made.down(event(1, 400, 300));
  made.move(event(1, 440, 300));
  made.up(event(1, 440, 300));
  assert.equal(seen.clicked.length, 1);
  assert.equal(made.x, -40 / made.scale);
  const dragged = [];
  seen.grabbed = (at) => dragged.push(at);
  made.down(event(1, 400, 300));
  made.move(event(1, 420, 300));
  made.up(event(1, 420, 300));
  assert.equal(dragged.length, 1);
  assert.equal(made.x, -40 / made.scale, "the map stays");
  seen.grabbed = null;
  const { scale } = made;
  made.down(event(1, 300, 300));
  made.down(event(2, 500, 300));
  made.move(event(2, 700, 300));
  assert.ok(Math.abs(made.scale / scale - 2) < 1e-9);
});
