// How fast the page is, and what it costs: node speed.mjs CONFIG.json
//
// A map of 5,000 rectangles (`hall` in the configuration) and 200 robots that say five times a
// second where they are; then one of 100,000 (`city`).

import { readFile } from "node:fs/promises";
import { setTimeout as pause } from "node:timers/promises";
import { Foreign, Person, Server, launch, until } from "./site.mjs";

const WATCHED_S = 20;
const config = JSON.parse(await readFile(process.argv[2], "utf8"));
const server = new Server({ ...config, args: ["--web-operator", "ada"] });
await server.start();
const foreign = new Foreign(config.python, config.endpoint);
const browser = await launch(config.chromium);

// Bytes over the wire since it was called, as the browser counts them.
async function bytesOf(person) {
  const wire = await person.context.newCDPSession(person.page);
  await wire.send("Network.enable");
  const count = { bytes: 0 };
  wire.on("Network.dataReceived", ({ encodedDataLength }) => (count.bytes += encodedDataLength));
  wire.on("Network.responseReceived", ({ response }) => (count.bytes += response.encodedDataLength));
  return count;
}

// Frames a second while a person drags the map about.
async function frames(person) {
  const box = await person.page.locator("canvas").boundingBox();
  const counted = person.page.evaluate(
    (ms) =>
      new Promise((tell) => {
        const begun = performance.now();
        const took = [];
        let last = begun;
        const frame = (now) => {
          took.push(now - last);
          last = now;
          if (now - begun < ms) return requestAnimationFrame(frame);
          took.sort((a, b) => a - b);
          tell({ frames: took.length / ((now - begun) / 1000), worst: took[Math.floor(0.99 * took.length)] });
        };
        requestAnimationFrame(frame);
      }),
    8000,
  );
  await person.page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await person.page.mouse.down();
  for (let turn = 0; turn < 200; turn += 1) {
    const angle = turn / 6;
    await person.page.mouse.move(
      box.x + box.width / 2 + 90 * Math.cos(angle),
      box.y + box.height / 2 + 90 * Math.sin(angle),
    );
    await pause(20);
  }
  await person.page.mouse.up();
  return counted;
}

// A person who opens a map: what came over the wire, and when it was drawn, milliseconds.
async function opened(map) {
  const person = await Person.at(browser, "about:blank");
  const count = await bytesOf(person);
  await person.page.goto(`http://${config.address}/#/${map}`);
  const drawn = await until("it is drawn", () =>
    person.page.evaluate(() => performance.getEntriesByName("map drawn")[0]?.startTime),
  );
  await person.isLive();
  await pause(1000);
  console.log(`joining ${map}: ${(count.bytes / 1e6).toFixed(2)} MB, drawn after ${drawn.toFixed(0)} ms`);
  return [person, count];
}

const said = ({ frames: rate, worst }) => `${rate.toFixed(0)} frames a second, 99 % within ${worst.toFixed(0)} ms`;

try {
  await until("the server answers", () => foreign.get("fht/maps"));
  await foreign.write(config.hall);
  await until("the map is there", async () => (await foreign.get("fht/hall/head")).version === config.hall.length);
  const [ada, count] = await opened("hall");
  const alone = await frames(ada);
  await foreign.order({ swarm: "hall", robots: 200, hz: 5, for_s: 90 });
  await until(
    "all robots are there",
    async () => (await ada.side("Map").textContent()) && (await foreign.get("fht/hall/head")),
  );
  await pause(3000);
  const busy = await frames(ada);
  console.log(`dragging, the map alone: ${said(alone)}`);
  console.log(`dragging, with 200 robots: ${said(busy)}`);
  count.bytes = 0;
  await pause(WATCHED_S * 1000);
  console.log(`watching: ${((count.bytes * 60) / WATCHED_S / 1e6).toFixed(2)} MB a minute`);
  await ada.end();
  await foreign.write(config.city);
  await until("the city is there", async () => (await foreign.get("fht/city/head")).version === config.city.length);
  const [ben] = await opened("city");
  console.log(`dragging the city: ${said(await frames(ben))}`);
  await ben.end();
} finally {
  await browser.close();
  foreign.end();
  await server.kill();
}
