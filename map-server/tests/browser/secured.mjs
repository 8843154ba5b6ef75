// Certificates decide who gets in and what the page offers: node secured.mjs CONFIG.json

import { readFile } from "node:fs/promises";
import { Foreign, Person, Server, check, launch, until } from "./site.mjs";

const config = JSON.parse(await readFile(process.argv[2], "utf8"));
const server = new Server({ ...config, args: config.flags });
await server.start();
const foreign = new Foreign(config.python, config.endpoint);
const browser = await launch(config.chromium);
const origin = `https://localhost:${config.address.split(":").at(-1)}`;

function shows(name) {
  const clientCertificates = [
    { origin, certPath: `${config.folder}/${name}.pem`, keyPath: `${config.folder}/${name}.key` },
  ];
  return { clientCertificates, ignoreHTTPSErrors: true };
}

try {
  await until("the server answers", () => foreign.get("fht/maps"));
  await foreign.write(config.begin);

  const stranger = await Person.at(browser, origin, { ignoreHTTPSErrors: true });
  check(
    (await stranger.page.locator("body").textContent()).includes("show a certificate of this site"),
    "a stranger is told why",
  );
  check((await stranger.page.goto(`${origin}/page/main.js`)).status() === 401, "and gets nothing else");
  await stranger.end();

  const tug = await Person.at(browser, `${origin}/#/lab`, shows("client-tug"));
  await tug.isLive();
  await until(
    "it is shown who looks",
    async () => (await tug.page.locator("#me").textContent()) === "tug (client), may look",
  );
  await until("the map is there", async () => (await tug.side("Map").textContent()).includes("main"));
  const tools = await tug.page.getByRole("toolbar").getByRole("button").allTextContents();
  check(tools.join() === "Look,Path,Measure,Clear", `only what it may do is offered: ${tools}`);
  const status = await tug.page.evaluate(async () => {
    const headers = { "Content-Type": "application/json" };
    const order = JSON.stringify({ op: "set_place", name: "dock", pose: [1, 0, 0] });
    return (await fetch("/api/change/lab", { method: "POST", headers, body: order })).status;
  });
  check(status === 403, `and nothing else is done: ${status}`);
  await tug.isAccessible("a map for those who look");
  await tug.end();

  const ada = await Person.at(browser, `${origin}/#/lab`, shows("operator-ada"));
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  await ada.press("Name a place");
  await ada.page.getByLabel("name of the place").fill("dock");
  await ada.press("Save the place");
  await until("a foreign client sees it", async () => (await foreign.get("fht/lab/rules")).places.length === 1);
  await ada.end();
} finally {
  await browser.close();
  foreign.end();
  await server.kill();
}
