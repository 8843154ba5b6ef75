// Looking: the list of maps, the map, coordinates, distances, growth, robots, health.

import { Person, check, until } from "./site.mjs";

async function maps_are_listed_and_searched({ browser, url, foreign }) {
  const ada = await Person.at(browser, url);
  await ada.isLive();
  const links = ada.page.locator("main td a");
  await until("both maps are there", async () => (await links.allTextContents()).join() === "lab,museum");
  const head = await foreign.get("fht/museum/head");
  const row = ada.page.locator("main tr", { hasText: "museum" });
  await until("its version is shown", async () => (await row.textContent()).includes(String(head.version)));
  await ada.page.getByRole("searchbox").fill("MUS");
  await until("one is found", async () => (await links.allTextContents()).join() === "museum");
  check((await ada.page.getByRole("status").allTextContents()).includes("1 of 2 maps"), "the count is told");
  await ada.isAccessible("the list");
  await links.click();
  await until("the map is shown", async () => (await ada.page.title()) === "museum · Maps");
  await ada.end();
}

async function the_map_is_moved_zoomed_and_measured({ browser, url }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const free = await until("free space is drawn", async () => {
    const colour = await ada.colourAt(5.5, 0.5);
    return colour[1] > colour[0] + 5 && colour;
  });
  const [x, y] = await ada.pixelsOf(5, 0);
  await ada.page.mouse.move(x, y);
  await ada.page.mouse.wheel(0, -600);
  const [nowX, nowY] = await ada.pixelsOf(5, 0);
  check(Math.hypot(nowX - x, nowY - y) < 3, "what is under the pointer stays there while it zooms");
  const metre = (await ada.pixelsOf(6, 0))[0] - nowX;
  await ada.press("Zoom out");
  check((await ada.pixelsOf(6, 0))[0] - (await ada.pixelsOf(5, 0))[0] < metre, "the button zooms");
  await ada.press("The whole map");
  const [beforeX] = await ada.pixelsOf(5, 0);
  await ada.drag([5, 0], [7, 0]);
  check(Math.abs((await ada.pixelsOf(3, 0))[0] - beforeX) < 4, "two metres to the right");
  await ada.press("The whole map");
  await ada.press("Measure");
  await ada.clickAt(1, 0);
  await ada.clickAt(4, 0);
  const said = await ada.said;
  check(Math.abs(Number.parseFloat(said) - 3) < 0.1, `three metres are measured: ${said}`);
  await ada.press("Look");
  await ada.clickAt(5, 0);
  check((await ada.said).startsWith("main node 0000000a.5"), await ada.said);
  await ada.page.getByText("Layers").click();
  await ada.page.getByLabel("walls").uncheck();
  await ada.isAccessible("a map");
  check(free.length === 3, "a colour");
  await ada.end();
}

async function a_map_grows_while_somebody_looks({ browser, url, foreign, later }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const about = ada.side("Map");
  await until("the version is shown", async () => (await about.textContent()).includes("version12"));
  await foreign.write(later);
  await until("it has grown", async () => (await about.textContent()).includes("version16"));
  await until("the new free space is drawn", async () => {
    const colour = await ada.colourAt(15.3, 0.5);
    return colour[1] > colour[0] + 5;
  });
  await ada.end();
}

const pose = (robot, more) => ({ robot, localized: false, state: "CANDIDATES", confidence: 0.62, ...more });

async function robots_come_and_go_with_their_state({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const status = { role: "client", map: "museum", version: 3, vector: { "0000000a": 3 } };
  const say = async (robot, message) => {
    await foreign.put(`fht/museum/robots/${robot}/status`, {
      ...status,
      robot,
      state: message.state,
      map_from_base: message.map_from_base,
    });
    await foreign.put(`fht/museum/robots/${robot}/pose`, message);
  };
  for (const robot of ["amr-7", "tug-1"]) await foreign.order({ token: `fht/museum/robots/${robot}` });
  const robots = ada.side("Robots");
  await until("a robot that knows where it is, and is behind", async () => {
    await say(
      "amr-7",
      pose("amr-7", { localized: true, state: "LOCALIZED", confidence: 0.97, map_from_base: [2, 0.5, 0] }),
    );
    const text = await robots.textContent();
    return text.includes("amr-7") && text.includes("LOCALIZED") && text.includes("13 behind");
  });
  await until("candidates with their probability", async () => {
    await say(
      "tug-1",
      pose("tug-1", {
        candidates: [
          [3, 0.5, 0],
          [8, 0.5, 3.14],
        ],
        probabilities: [0.62, 0.3],
      }),
    );
    return (await robots.textContent()).includes("2 candidates: 62 %, 30 %");
  });
  await until("where it is sent, and the way there", async () => {
    await say(
      "amr-7",
      pose("amr-7", { localized: true, state: "LOCALIZED", confidence: 0.97, map_from_base: [2, 0.5, 0] }),
    );
    await foreign.put("fht/museum/robots/amr-7/goal/status", {
      robot: "amr-7",
      state: "DRIVING",
      id: "1",
      goal: [13, 0.5],
      to_go_m: 11,
    });
    return (await robots.textContent()).includes("drives: 11 m to go");
  });
  await ada.press("The whole map");
  await until("a candidate is drawn", async () => {
    const [red, green, blue] = await ada.colourAt(8, 0.5);
    return blue > green + 20 && red > green;
  });
  await ada.clickAt(2, 0.5);
  check((await ada.said) === "robot amr-7, LOCALIZED", await ada.said);
  await ada.press("amr-7");
  const box = await ada.page.locator("canvas").boundingBox();
  const [x] = await ada.pixelsOf(2, 0.5);
  check(Math.abs(x - box.x - box.width / 2) < 4, "it is shown in the middle");
  for (const robot of ["amr-7", "tug-1"]) await foreign.order({ drop: `fht/museum/robots/${robot}` });
  await until("they have gone", async () => !(await robots.textContent()).includes("LOCALIZED"));
  await ada.end();
}

async function health_is_shown({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#health`);
  await ada.isLive();
  const main = ada.page.locator("main");
  await until("paths are counted", async () => {
    await foreign.get("fht/museum/path?from=0,0;to=9,0");
    const row = await ada.page.locator("main tr", { hasText: /^path/ }).first().allTextContents();
    return /^path\d+\.\d/.test(row.join()) && (await main.textContent()).includes("room left on the disk");
  });
  check((await main.textContent()).includes("takes in what is writtenyes"), "it takes in what is written");
  check(/Zenoh sessions\d+ client/.test(await main.textContent()), "who is connected");
  await ada.isAccessible("health");
  await ada.end();
}

// In this order: the map grows on the way.
export default [
  maps_are_listed_and_searched,
  the_map_is_moved_zoomed_and_measured,
  a_map_grows_while_somebody_looks,
  robots_come_and_go_with_their_state,
  health_is_shown,
];
