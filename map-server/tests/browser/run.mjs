// Runs all scenarios on a server of their own: node run.mjs CONFIG.json [SCENARIO …]
//
// The configuration names programs (program, python, chromium), a folder for data, the endpoint
// and the address to serve at, and the increments of the map (begin, later, last).

import { readFile } from "node:fs/promises";
import looking from "./looking.mjs";
import { Foreign, Server, launch, until } from "./site.mjs";
import steering from "./steering.mjs";
import together from "./together.mjs";

const [file, ...wanted] = process.argv.slice(2);
const config = JSON.parse(await readFile(file, "utf8"));
const server = new Server({ ...config, args: ["--web-operator", "ada"] });
await server.start();
const foreign = new Foreign(config.python, config.endpoint);
const browser = await launch(config.chromium);
const url = `http://${config.address}/`;
let failed = 0;
try {
  await until("the server answers", () => foreign.get("fht/maps"));
  await foreign.write(config.begin);
  await until("the maps are there", async () => {
    const { maps } = await foreign.get("fht/maps");
    return maps.map(({ map, version }) => `${map} ${version}`).join() === "lab 3,museum 12";
  });
  for (const scenario of [...looking, ...steering, ...together]) {
    const { name } = scenario;
    if (wanted.length && !wanted.includes(name)) continue;
    const begun = Date.now();
    try {
      await scenario({ browser, url, server, foreign, later: config.later, last: config.last });
      console.log(`ok      ${name} (${Date.now() - begun} ms)`);
    } catch (error) {
      failed += 1;
      console.log(`FAILED  ${name}: ${error.stack}`);
      for (const context of browser.contexts()) await context.close();
    }
  }
} finally {
  await browser.close();
  foreign.end();
  await server.kill();
}
process.exitCode = failed ? 1 : 0;
