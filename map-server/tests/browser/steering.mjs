// Steering: paths, places, zones, closures, undo, erasing, releases, time.

import { Person, check, until } from "./site.mjs";

async function a_path_is_asked_by_two_clicks_and_its_line_copied({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`, { permissions: ["clipboard-read", "clipboard-write"] });
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  await ada.press("Path");
  await ada.clickAt(1, 0);
  await ada.clickAt(9, 0);
  const answer = ada.side("Path");
  const text = await until("an answer", async () => (await answer.textContent()).match(/(\d+\.\d\d) m, answered in/));
  await ada.press("Copy the line");
  const line = await until("it is copied", () => ada.page.evaluate(() => navigator.clipboard.readText()));
  const selector = /get -s '(.*)' --decoder json$/.exec(line)[1];
  const path = await foreign.get(selector);
  check(path.length_m.toFixed(2) === text[1] && Math.abs(path.length_m - 8) < 0.2, `${line}: ${path.length_m}`);
  await answer.getByLabel("from").fill("0,0");
  await answer.getByLabel("to").fill("quay");
  await answer.getByRole("button", { name: "Find the path" }).click();
  await until("a refusal in words", async () => (await answer.textContent()).includes("no place called quay"));
  await ada.end();
}

async function a_place_is_named_by_mouse_and_by_keyboard({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  // The server's answer comes late.
  let comes;
  const answer = new Promise((resolve) => (comes = resolve));
  await ada.page.route("**/api/change/**", async (route) => {
    const response = await route.fetch();
    await answer;
    await route.fulfill({ response });
  });
  await ada.press("Name a place");
  await ada.clickAt(9, 0);
  await ada.page.keyboard.type("dock");
  await ada.page.keyboard.press("Enter");
  const place = async (name) => (await foreign.get("fht/museum/rules")).places.find((known) => known.name === name);
  const dock = await until("a foreign client sees it", () => place("dock"));
  check(Math.hypot(dock.pose[0] - 9, dock.pose[1]) < 0.1, JSON.stringify(dock));

  // Without a mouse: to the tool, to the fields, and type.
  const tool = ada.page.getByRole("button", { name: "Name a place" });
  await tool.focus();
  await ada.page.keyboard.press("Enter");
  const form = ada.side("Places, zones, closures");
  const next = await form.getByLabel("name of the place").elementHandle();
  comes();
  await until("the first one is told", async () => (await ada.said).includes("dock"));
  check(await next.evaluate((field) => field.isConnected), "the next one's form is still there");
  await ada.page.unroute("**/api/change/**");
  for (const [label, text] of [
    ["name of the place", "Küche"],
    ["x, m", "1.5"],
    ["y, m", "-0.5"],
    ["heading, °", "90"],
  ]) {
    await form.getByLabel(label).focus();
    await ada.page.keyboard.press("Control+A");
    await ada.page.keyboard.type(text);
  }
  await ada.page.keyboard.press("Enter");
  const kitchen = await until("the second one, too", () => place("Küche"));
  check(kitchen.pose[0] === 1.5 && Math.abs(kitchen.pose[2] - Math.PI / 2) < 1e-3, JSON.stringify(kitchen));
  await ada.isAccessible("a map with places");
  await ada.end();
}

async function what_is_doubtful_is_written_when_somebody_insists({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  await ada.page.getByRole("button", { name: "Name a place" }).focus();
  await ada.page.keyboard.press("Enter");
  const form = ada.side("Places, zones, closures");
  for (const [label, text] of [
    ["name of the place", "moon"],
    ["x, m", "500"],
    ["y, m", "500"],
  ]) {
    await form.getByLabel(label).fill(text);
  }
  await ada.page.keyboard.press("Enter");
  await until("it is doubted", async () => (await ada.said).includes("with force"));
  const moon = async () => (await foreign.get("fht/museum/rules")).places.some(({ name }) => name === "moon");
  check(!(await moon()), "nothing is written yet");
  await ada.press("Write it all the same");
  await until("it is written", moon);
  await ada.press("Undo my last change");
  await until("and taken back", async () => !(await moon()));
  await ada.page.goto(`${url}#/no%20map`);
  await until("no map has such a name", async () =>
    (await ada.page.locator("main").textContent()).includes("there can be no map called no map"),
  );
  await ada.end();
}

async function the_map_goes_by_keyboard_alone({ browser, url }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  const focused = () => ada.page.evaluate(() => document.activeElement.textContent || document.activeElement.tagName);
  const seen = [];
  for (let steps = 0; steps < 60 && !seen.includes("CANVAS"); steps += 1) {
    await ada.page.keyboard.press("Tab");
    seen.push(await focused());
  }
  check(
    ["To the content", "Maps", "Look", "Path", "Erase", "Clear"].every((name) => seen.includes(name)),
    seen.join(),
  );
  await ada.page.keyboard.press("+");
  await ada.page.keyboard.press("ArrowRight");
  await ada.page.keyboard.press("Enter");
  check((await ada.said) !== "", "Enter clicks in the middle");
  const [before] = (await ada.page.locator(".under .soft").textContent()).match(/-?\d+\.\d+/);
  await ada.page.keyboard.press("ArrowRight");
  const [after] = (await ada.page.locator(".under .soft").textContent()).match(/-?\d+\.\d+/);
  check(Number(after) > Number(before), `${before} to ${after}`);
  await ada.end();
}

async function a_zone_is_previewed_drawn_changed_and_taken_back({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const zones = async () => (await foreign.get("fht/museum/rules")).zones;
  const form = ada.side("Places, zones, closures");
  await until("places are there", async () => (await form.textContent()).includes("dock"));
  await ada.press("Draw a zone");
  for (const corner of [
    [4.5, -1.5],
    [5.5, -1.5],
    [5.5, 1.5],
    [4.5, 1.5],
  ])
    await ada.clickAt(...corner);
  await form.getByLabel("name of the zone").fill("wet");
  await ada.press("What would change?");
  await until("the path that would be none is told", async () =>
    (await form.textContent()).includes("1 of 1 paths between places would change"),
  );
  check((await form.textContent()).includes("then none"), "between the kitchen and the dock");
  check((await zones()).length === 0, "looking ahead writes nothing");
  await ada.isAccessible("a zone that is drawn");
  await ada.press("Save the zone");
  const [wet] = await until("a foreign client sees it", async () => (await zones()).length === 1 && zones());
  check(wet.rule === "keep_out" && Math.abs(wet.corners[0][0] - 4.5) < 0.1, JSON.stringify(wet));
  await until("no path leads through", async () => {
    const reply = await foreign.order({ get: "fht/museum/path?from=0,0;to=dock" });
    return reply.refused?.includes("NO_PATH");
  });

  await until("it is listed", async () => (await form.textContent()).includes("zone wet: keep out"));
  await form.getByRole("button", { name: "Edit: zone wet: keep out" }).click();
  await ada.drag([5.5, 1.5], [6.5, 1.5]);
  await form.getByLabel("at most, m/s").fill("0.3");
  await ada.press("Save the zone");
  await until("it is slow and larger", async () => {
    const [zone] = await zones();
    return zone.rule.speed_limit === 0.3 && zone.corners.some(([x]) => Math.abs(x - 6.5) < 0.1);
  });
  await ada.press("Undo my last change");
  await until("it is closed again", async () => (await zones())[0].rule === "keep_out");
  await until("its Remove button", async () => (await form.textContent()).includes("zone wet: keep out"));
  await form.getByRole("button", { name: "Remove: zone wet: keep out" }).click();
  await until("it has gone", async () => (await zones()).length === 0);
  await until("the journal tells it", async () =>
    (await ada.side("Changes").textContent()).includes("ada: zone wet is taken away"),
  );
  await ada.end();
}

async function an_edge_is_closed_and_opened({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const closed = async () => (await foreign.get("fht/museum/rules")).closed_edges;
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  await ada.press("Close an edge");
  await ada.clickAt(6.5, 0);
  await ada.press("Close it");
  await until("a foreign client sees it", async () => (await closed()).join() === "0000000a.6,0000000a.7");
  await ada.page.getByRole("button", { name: /^Open: closed:/ }).click();
  await until("it is open", async () => (await closed()).length === 0);
  await ada.end();
}

async function nodes_are_erased_and_come_back({ browser, url, foreign }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const count = async () => (await foreign.get("fht/museum/nodes?near=0,0;radius=100;limit=100")).nodes.length;
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  await ada.press("The whole map");
  await ada.press("Erase");
  for (const corner of [
    [13.5, -0.9],
    [15.5, -0.9],
    [15.5, 0.9],
    [13.5, 0.9],
  ])
    await ada.clickAt(...corner);
  await ada.press("Erase 2 nodes");
  await until("they have gone", async () => (await count()) === 14);
  await ada.press("Undo my last change");
  await until("they are there again", async () => (await count()) === 16);
  const journal = async () => (await ada.side("Changes").textContent()).split("ada: ");
  await until("both stand in the journal", async () => {
    const [, undo, erased] = await journal();
    return undo.startsWith("2 nodes are put") && erased.startsWith("2 nodes are taken away");
  });
  await ada.end();
}

async function a_release_is_made_enabled_and_compared({ browser, url, foreign, last }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const releases = async () => (await foreign.get("fht/museum/releases")).releases;
  const form = ada.side("Releases");
  await form.getByLabel("name of the release").fill("spring.1");
  await ada.press("Make a release");
  await until("a foreign client sees it", async () => (await releases()).some(({ name }) => name === "spring.1"));
  await until("it is listed", async () => (await form.textContent()).includes("spring.1"));
  await form.getByRole("button", { name: "Enable: spring.1" }).click();
  await until("robots use it", async () => (await foreign.get("fht/museum/head")).enabled?.startsWith("spring.1@"));
  await foreign.write(last);
  await until("the map has grown", async () => (await ada.side("Map").textContent()).includes("4 main, 13 support"));
  await form.getByRole("button", { name: "Compare: spring.1" }).click();
  await until("what is new is told", async () => (await form.textContent()).includes("to now: 1 node added."));
  await ada.press("The whole map");
  await until("and drawn", async () => {
    const [red, green] = await ada.colourAt(16.4, 0.7);
    return green > red + 22;
  });
  await ada.isAccessible("a comparison");
  await ada.press("End the comparison");
  await until("the button to go on", () => form.getByRole("button", { name: "Enable the newest state" }).isVisible());
  await ada.press("Enable the newest state");
  await until("robots use the newest state", async () => (await foreign.get("fht/museum/head")).enabled === undefined);
  await ada.end();
}

async function the_map_is_seen_as_it_was({ browser, url }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const time = ada.side("Time");
  const slider = time.getByRole("slider");
  await until("the slider knows the versions", async () => Number(await slider.getAttribute("max")) >= 17);
  await slider.focus();
  await ada.page.keyboard.press("Home");
  await until("the first version", async () => (await time.textContent()).includes("version 1 of"));
  for (let steps = 0; steps < 3; steps += 1) await ada.page.keyboard.press("ArrowRight");
  await until("the fourth, with four nodes", async () => /version 4 of \d+, 4 nodes/.test(await time.textContent()));
  const isGrey = async () => {
    const [red, green] = await ada.colourAt(9.5, 0.5);
    return Math.abs(red - green) < 5;
  };
  await until("what came later is not drawn", isGrey);
  await ada.press("Play its growth");
  await until("it plays to the end", async () => (await time.textContent()).includes("the newest state"));
  await until("and all is drawn again", async () => !(await isGrey()));
  await ada.end();
}

async function a_floor_plan_lies_under_the_map_and_is_kept({ browser, url, foreign, server }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  const isRed = async () => {
    const [red, green] = await ada.colourAt(5.5, 3);
    return red > green + 80;
  };
  const svg =
    '<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100"><rect width="100" height="100" fill="#f00"/></svg>';
  const plan = ada.side("Floor plan");
  await plan
    .getByLabel("image of the floor plan")
    .setInputFiles({ name: "plan.svg", mimeType: "image/svg+xml", buffer: Buffer.from(svg) });
  for (const [label, value] of [
    ["metres a pixel", "0.1"],
    ["lower left y, m", "2"],
    ["strength, 0 to 1", "1"],
  ]) {
    await plan.getByLabel(label).fill(value);
  }
  await until("it is drawn", isRed);
  await ada.isAccessible("a floor plan");
  await ada.page.reload();
  await until("it is there again", isRed);
  const floorPlan = async () => (await foreign.get("fht/museum/rules")).floor_plan;
  check((await floorPlan()) === undefined, "it is in this browser only");
  const side = ada.side("Floor plan");
  await side.getByRole("button", { name: "Write into the map how it lies" }).click();
  await until("a foreign client sees how it lies", async () => {
    const { image, metres_per_pixel: scale, map_from_image: corner } = (await floorPlan()) ?? {};
    return image === "plan.svg" && scale === 0.1 && JSON.stringify(corner) === "[0,2,0]";
  });
  // Somebody else corrects it: it moves here.
  await server.command("floor-plan", "museum", "plan.svg", "--scale", "0.1", "--at", "0,-40");
  await until("it lies elsewhere", async () => !(await isRed()));
  check((await side.getByLabel("lower left y, m").inputValue()) === "-40", "the field says so");
  await side.getByRole("button", { name: "Take it out of the map" }).click();
  await until("the map says nothing of it", async () => (await floorPlan()) === undefined);
  await side.getByLabel("lower left y, m").fill("2");
  await until("it is red again", isRed);
  await side.getByRole("button", { name: "Take the image away" }).click();
  await until("and gone", async () => !(await isRed()));
  await ada.end();
}

async function the_map_is_put_on_earth({ browser, url, foreign, server }) {
  const ada = await Person.at(browser, `${url}#/museum`);
  await ada.isLive();
  const earth = ada.side("Where on earth");
  await until("nobody has said", async () => (await earth.textContent()).includes("Nobody has said"));
  for (const [label, value] of [
    ["latitude of the origin, °", "45"],
    ["longitude of the origin, °", "9"],
    ["x axis, ° from east", "90"],
  ]) {
    await earth.getByLabel(label).fill(value);
  }
  await earth.getByRole("button", { name: "Save where it is" }).click();
  const datum = async () => (await foreign.get("fht/museum/rules")).datum;
  await until("a foreign client sees it", async () => {
    const { latitude, longitude, yaw } = (await datum()) ?? {};
    return latitude === 45 && longitude === 9 && Math.abs(yaw - Math.PI / 2) < 1e-4;
  });
  await until("the pointer is somewhere on earth", async () => {
    await ada.page.mouse.move(...(await ada.pixelsOf(5, 0.5)));
    return /45\.0000\d+°, 8\.99999\d+°/.test(await ada.page.locator(".under").textContent());
  });
  await ada.isAccessible("where on earth");
  await ada.press("Undo my last change");
  await until("it is taken back", async () => (await datum()) === undefined);
  await server.command("datum", "museum", "46,9.5,0");
  await until("others' words are shown", async () => (await earth.textContent()).includes("latitude 46°"));
  await earth.getByRole("button", { name: "Take it away" }).click();
  await until("and it is gone", async () => (await datum()) === undefined);
  await ada.end();
}

// In this order: the map grows on the way.
export default [
  a_path_is_asked_by_two_clicks_and_its_line_copied,
  a_place_is_named_by_mouse_and_by_keyboard,
  what_is_doubtful_is_written_when_somebody_insists,
  the_map_goes_by_keyboard_alone,
  a_zone_is_previewed_drawn_changed_and_taken_back,
  an_edge_is_closed_and_opened,
  nodes_are_erased_and_come_back,
  a_release_is_made_enabled_and_compared,
  the_map_is_seen_as_it_was,
  a_floor_plan_lies_under_the_map_and_is_kept,
  the_map_is_put_on_earth,
];
