// What the page knows of one map: read once, and then followed by events. An event tells whole
// nodes as they are now, so what comes twice does no harm; a gap in the versions is read anew.

import { ask, askWalls } from "./api.js";

const MOST_NODES = 20000; // of a larger map those nearest to where somebody looks are shown
const PAGE = 1000;
const GAP_MS = 1500;
const WALLS_EVERY_MS = 3000;
const ELSEWHERE_MS = 500;
const WAY_EVERY_MS = 3000;
const MOST_WAYS = 20; // robots whose ways are asked for
const JOURNAL = [20, 200]; // changes that are shown: at first, and at most

export class MapStore {
  constructor(map, changed) {
    Object.assign(this, { map, changed });
    this.nodes = new Map();
    this.robots = new Map();
    this.goals = new Map();
    this.ways = new Map();
    this.fleet = [];
    this.head = null;
    this.version = -1;
    this.truncated = false;
    this.isLoaded = false; // until then it is not known what the map has not
    this.walls = [];
    this.rules = { places: [], zones: [], closed_edges: [], blocked: [] };
    this.releases = [];
    this.journal = { entries: [] };
    [this.journalLimit] = JOURNAL;
    // An earlier state that is shown in place of the newest; and a count of what is drawn.
    this.past = null;
    this.drawing = 0;
  }

  // What is shown: the newest state, or an earlier one.
  shown() {
    return this.past ?? this;
  }

  redraw() {
    this.drawing += 1;
    this.changed();
  }

  async load(near = [0, 0]) {
    this.loading = (this.loading ?? 0) + 1;
    const turn = this.loading;
    const nodes = new Map();
    let [after, version] = ["", -1];
    do {
      const asked = { near: near.join(","), radius: 100000, limit: PAGE, after };
      const page = await ask(this.map, "nodes", asked);
      version = version < 0 ? page.version : Math.min(version, page.version);
      for (const node of page.nodes) nodes.set(node.id, node);
      after = page.next ?? "";
    } while (after && nodes.size < MOST_NODES);
    if (turn !== this.loading) return; // a newer one is under way
    // They come nearest first.
    const { x, y } = [...nodes.values()].at(-1) ?? { x: near[0], y: near[1] };
    Object.assign(this, { nodes, version, truncated: after !== "", near, reach: Math.hypot(x - near[0], y - near[1]) });
    this.redraw();
    await this.loadHead();
    await Promise.all([this.loadRules(), this.loadWalls(), this.loadJournal()]);
    this.isLoaded = true;
    this.changed();
  }

  // A head that comes while another is asked for is newer than the answer may be.
  async loadHead() {
    const before = this.head;
    const head = await ask(this.map, "head");
    if (this.head === before) this.head = head;
  }

  // Somebody looks elsewhere: of a large map other nodes are near then.
  looksAt([x, y]) {
    clearTimeout(this.elsewhere);
    if (!this.truncated || Math.hypot(x - this.near[0], y - this.near[1]) < this.reach / 2) return;
    this.elsewhere = setTimeout(() => this.load([x, y]).catch(() => {}), ELSEWHERE_MS);
  }

  async loadRules() {
    const [rules, { releases }] = await Promise.all([ask(this.map, "rules"), ask(this.map, "releases")]);
    Object.assign(this, { rules, releases });
    this.redraw();
  }

  async loadJournal() {
    this.journal = await ask(this.map, "journal", { limit: this.journalLimit });
    this.changed();
  }

  mayShowMore() {
    return this.journalLimit < JOURNAL[1];
  }

  showMoreJournal() {
    [, this.journalLimit] = JOURNAL;
    return this.loadJournal();
  }

  async loadWalls() {
    const seen = await askWalls(this.map, this.near ?? [0, 0], 100000);
    this.walls = seen.points;
    this.redraw();
  }

  async loadFleet() {
    this.fleet = (await ask(this.map, "fleet", { limit: 1000 })).robots;
    const here = new Set(this.fleet.filter((robot) => robot.alive).map((robot) => robot.status.robot));
    for (const name of this.robots.keys()) if (!here.has(name)) this.robots.delete(name);
    // A status tells where a robot is before its first pose comes.
    for (const { alive, status } of this.fleet) {
      if (alive && !this.robots.has(status.robot)) {
        this.robots.set(status.robot, {
          robot: status.robot,
          state: status.state,
          map_from_base: status.map_from_base,
        });
      }
    }
    this.changed();
  }

  takeHead(head) {
    this.head = head;
    clearTimeout(this.gap);
    if (head.version > this.version) {
      this.gap = setTimeout(() => this.version < head.version && this.reload(), GAP_MS);
    }
    this.changed();
  }

  takeGrown(grown) {
    if (grown.reload || grown.from > this.version) return this.reload();
    for (const id of grown.gone) this.nodes.delete(id);
    for (const node of grown.nodes) if (this.nodes.has(node.id) || !this.truncated) this.nodes.set(node.id, node);
    this.version = Math.max(this.version, grown.version);
    if (grown.rules) this.loadRules().catch(() => {});
    if (grown.rules || grown.gone.length) this.loadJournal().catch(() => {});
    if (grown.gone.length || grown.nodes.some((node) => node.kind === "main")) this.wallsSoon();
    this.redraw();
  }

  wallsSoon() {
    this.wallsTimer ??= setTimeout(() => {
      this.wallsTimer = undefined;
      this.loadWalls().catch(() => {});
    }, WALLS_EVERY_MS);
  }

  takeRobots({ robots }) {
    for (const robot of robots) this.robots.set(robot.robot, robot);
    this.changed();
  }

  // Where robots are sent.
  takeGoals({ goals }) {
    for (const goal of goals) {
      this.goals.set(goal.robot, goal);
      if (goal.state !== "DRIVING") this.ways.delete(goal.robot);
      else this.loadWay(goal).catch(() => {});
    }
    this.changed();
  }

  // A robot does not tell its path: this is the one that the server would plan now.
  async loadWay({ robot, goal }) {
    const pose = this.robots.get(robot)?.map_from_base;
    const known = this.ways.get(robot);
    if (!pose || !goal || (known && performance.now() - known.at < WAY_EVERY_MS)) return;
    if (!known && this.ways.size >= MOST_WAYS) return;
    this.ways.set(robot, { at: performance.now(), corners: known?.corners ?? [] });
    const [from, to] = [pose, goal].map((at) =>
      at
        .slice(0, 2)
        .map((metres) => metres.toFixed(3))
        .join(","),
    );
    const { waypoints } = await ask(this.map, "path", { from, to, to_nearest: true });
    if (this.ways.has(robot))
      this.ways.set(robot, { at: performance.now(), corners: waypoints.map(({ x, y }) => [x, y]) });
    this.changed();
  }

  takeGone({ robot }) {
    for (const of of [this.robots, this.goals, this.ways]) of.delete(robot);
    this.changed();
  }

  // Shows an earlier state; null: the newest again.
  showPast(past) {
    this.past = past;
    this.redraw();
  }

  reload() {
    this.load(this.near).catch(() => {});
  }

  bounds() {
    let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const { x, y, free_space: rect } of this.nodes.values()) {
      const [w, s, e, n] = rect ?? [x, y, x, y];
      [west, south, east, north] = [Math.min(west, w), Math.min(south, s), Math.max(east, e), Math.max(north, n)];
    }
    return west <= east ? [west, south, east, north] : [-5, -5, 5, 5];
  }

  end() {
    for (const timer of [this.gap, this.wallsTimer, this.elsewhere]) clearTimeout(timer);
    this.loading = -1;
  }
}

// All edges once: pairs of nodes.
export function* edgesOf(nodes) {
  for (const node of nodes.values()) {
    for (const other of node.neighbours) {
      const end = nodes.get(other);
      if (end && node.id < end.id) yield [node, end];
    }
  }
}

// An earlier state, as it was asked for.
export function pastOf({ version, nodes, places, zones, closed_edges: closed, points, oldest }) {
  const rules = { places, zones, closed_edges: closed, blocked: [] };
  return { version, nodes: new Map(nodes.map((node) => [node.id, node])), rules, walls: points, oldest };
}
