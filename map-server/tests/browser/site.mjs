// A running server, a foreign Zenoh client, and a browser: what all scenarios begin with.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import { setTimeout as pause } from "node:timers/promises";
import { chromium } from "playwright-core";

export const PATIENCE_MS = 60_000;
const FLAGS = [
  "--headless",
  "--no-sandbox",
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

const axe = await readFile(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export function check(holds, words) {
  if (!holds) throw new Error(words);
}

// Waits until something is so, however long a loaded machine takes.
export async function until(words, look) {
  const begun = Date.now();
  let last;
  while (Date.now() - begun < PATIENCE_MS) {
    try {
      last = await look();
      if (last) return last;
    } catch (error) {
      last = error;
    }
    await pause(30);
  }
  throw new Error(`never came: ${words} (last: ${last instanceof Error ? last.message : JSON.stringify(last)})`);
}

// `map-server --web`, which can be killed and started again.
export class Server {
  constructor({ program, data, endpoint, address, args }) {
    Object.assign(this, { program, data, endpoint, address, args });
  }

  async start() {
    const args = ["--data", this.data, "--listen", this.endpoint, "--web", this.address, ...this.args];
    this.process = spawn(this.program, args, { stdio: ["ignore", "inherit", "pipe"] });
    this.said = "";
    this.process.stderr.on("data", (bytes) => (this.said = (this.said + bytes).slice(-4000)));
    this.process.on("error", (error) => (this.said += error.message));
    await until(
      "the server says where the page is",
      () => this.said.includes("the page is at") || this.process.exitCode !== null,
    );
    check(this.process.exitCode === null, `the server ended: ${this.said}`);
  }

  async kill() {
    if (this.process.exitCode !== null || this.process.signalCode) return;
    const ended = once(this.process, "exit");
    this.process.kill("SIGKILL");
    await ended;
  }

  // An operator's command, run as people run it.
  async command(...args) {
    const run = spawn(this.program, [...args, "--connect", this.endpoint], { stdio: ["ignore", "pipe", "pipe"] });
    let text = "";
    for (const stream of [run.stdout, run.stderr]) stream.on("data", (bytes) => (text += bytes));
    const [code] = await once(run, "close");
    check(code === 0, `map-server ${args.join(" ")}: ${text}`);
    return text;
  }
}

// Somebody else's Zenoh.
export class Foreign {
  constructor(python, endpoint) {
    const script = new URL("foreign.py", import.meta.url).pathname;
    this.process = spawn(python, [script, endpoint], { stdio: ["pipe", "pipe", "inherit"] });
    this.lines = createInterface({ input: this.process.stdout })[Symbol.asyncIterator]();
    this.turn = Promise.resolve();
  }

  // One order after another.
  order(order) {
    const answered = this.turn.then(async () => {
      this.process.stdin.write(`${JSON.stringify(order)}\n`);
      const { value, done } = await this.lines.next();
      check(!done, "the foreign client has ended");
      return JSON.parse(value);
    });
    this.turn = answered.catch(() => {});
    return answered;
  }

  async get(selector) {
    const reply = await this.order({ get: selector });
    check("ok" in reply, `${selector}: ${reply.refused}`);
    return reply.ok;
  }

  put(key, value) {
    return this.order({ put: key, value });
  }

  // Increments as an explorer puts them, keys, and bytes in hexadecimal: again, until a head covers
  // them.
  async write(increments) {
    await until("the increments are stored", async () => {
      for (const { key, bytes } of increments) await this.order({ put_bytes: key, bytes });
      await pause(100);
      const ends = increments.map(({ key }) => key.split("/"));
      const { ok: head } = await this.order({ get: `fht/${ends[0][1]}/head` });
      return head && ends.every(([, , , author, number]) => head.vector[author] >= Number(number));
    });
  }

  end() {
    this.process.stdin.end();
  }
}

// A person at a browser of their own.
export class Person {
  static async at(browser, url, options = {}) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
    context.setDefaultTimeout(PATIENCE_MS);
    const page = await context.newPage();
    const person = new Person(context, page);
    page.on("pageerror", (error) => person.errors.push(error.message));
    page.on("console", (message) => message.type() === "error" && person.complaints.push(message.text()));
    await page.goto(url);
    return person;
  }

  constructor(context, page) {
    Object.assign(this, { context, page, errors: [], complaints: [] });
  }

  // What the page says under the map.
  get said() {
    return this.page.locator(".under [role=status]").textContent();
  }

  press(name, options = {}) {
    return this.page.getByRole("button", { name, exact: true, ...options }).click();
  }

  side(name) {
    return this.page.locator(".side > details", { has: this.page.getByRole("heading", { name, exact: true }) });
  }

  async isLive() {
    await until("the page is live", async () => (await this.page.locator("#link").textContent()) === "live");
  }

  // Pixels of a place on the map, as the coordinates under the pointer tell.
  async pixelsOf(x, y) {
    const box = await this.page.locator("canvas").boundingBox();
    const read = async (px, py) => {
      await this.page.mouse.move(px, py);
      // On a busy machine the coordinates come a little later.
      await this.page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
      return until("the coordinates are shown", async () => {
        const text = await this.page.locator(".under .soft").textContent();
        const numbers = [...text.matchAll(/-?\d+\.\d+/g)].map(([number]) => Number(number));
        return numbers.length >= 2 && numbers;
      });
    };
    const [ax, ay] = [box.x + 20, box.y + 20];
    // Clear of what lies over its lower edge.
    const [bx, by] = [box.x + box.width - 200, box.y + box.height - 120];
    const [[west, north], [east, south]] = [await read(ax, ay), await read(bx, by)];
    return [ax + ((x - west) / (east - west)) * (bx - ax), ay + ((north - y) / (north - south)) * (by - ay)];
  }

  async clickAt(x, y) {
    await this.page.mouse.click(...(await this.pixelsOf(x, y)));
  }

  async drag([ax, ay], [bx, by]) {
    const [from, to] = [await this.pixelsOf(ax, ay), await this.pixelsOf(bx, by)];
    await this.page.mouse.move(...from);
    await this.page.mouse.down();
    await this.page.mouse.move((from[0] + to[0]) / 2, (from[1] + to[1]) / 2);
    await this.page.mouse.move(...to);
    await this.page.mouse.up();
  }

  // The colour of the canvas at a place, as red, green, blue.
  async colourAt(x, y) {
    const [px, py] = await this.pixelsOf(x, y);
    return this.page.evaluate(
      ([left, top]) => {
        const canvas = document.querySelector("canvas");
        const box = canvas.getBoundingClientRect();
        const ratio = canvas.width / box.width;
        return [
          ...canvas
            .getContext("2d")
            .getImageData((left - box.left) * ratio, (top - box.top) * ratio, 1, 1)
            .data.slice(0, 3),
        ];
      },
      [px, py],
    );
  }

  // What keeps people with other senses out: nothing serious may.
  async isAccessible(where) {
    // The page's policy forbids scripts of others: axe is run by the browser's debugger.
    await this.page.evaluate(axe);
    const { violations } = await this.page.evaluate(() =>
      globalThis.axe.run(document, { resultTypes: ["violations"] }),
    );
    const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
    const words = serious.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(" ")}`);
    check(serious.length === 0, `${where}: ${words.join("\n")}`);
  }

  async end() {
    check(this.errors.length === 0, `the page failed: ${this.errors.join("\n")}`);
    await this.context.close();
  }
}

export function launch(executable) {
  return chromium.launch({ executablePath: executable, args: FLAGS });
}
