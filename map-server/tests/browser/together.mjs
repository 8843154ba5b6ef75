// Several people, a server that goes and comes, and names that would be markup.

import { Person, check, until } from "./site.mjs";

async function two_browsers_see_each_others_changes({ browser, url }) {
  const [ada, ben] = [await Person.at(browser, `${url}#/lab`), await Person.at(browser, `${url}#/lab`)];
  for (const person of [ada, ben]) {
    await person.isLive();
    await until("the map is there", async () => (await person.side("Map").textContent()).includes("main"));
  }
  const seen = [];
  for (const name of ["gate-1", "gate-2", "gate-3", "gate-4", "gate-5"]) {
    await ada.press("Name a place");
    await ada.clickAt(1, 0.2);
    await ada.page.getByLabel("name of the place").fill(name);
    // From the press to when the other page shows it, by this machine's one clock.
    const shown = ben.page.evaluate(
      (wanted) =>
        new Promise((tell) => {
          const list = document.querySelector(".side");
          const look = () => list.textContent.includes(`place ${wanted} `) && (tell(Date.now()), true);
          look() ||
            new MutationObserver((_, watch) => look() && watch.disconnect()).observe(list, {
              childList: true,
              subtree: true,
            });
        }),
      name,
    );
    const pressed = Date.now();
    await ada.press("Save the place");
    seen.push((await shown) - pressed);
  }
  console.log(`figure: another browser shows a change after ${seen.join(", ")} ms`);
  for (const person of [ada, ben]) await person.end();
}

async function a_restarted_server_is_shown_and_heals_without_reloading({ browser, url, server, foreign }) {
  const ada = await Person.at(browser, `${url}#/lab`);
  await ada.isLive();
  await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
  await ada.page.evaluate(() => (globalThis.isTheSamePage = true));
  await server.kill();
  await until("it is shown", async () => (await ada.page.locator("#link").textContent()).includes("connection lost"));
  await ada.isAccessible("a lost connection");
  await server.start();
  await ada.isLive();
  await until("the foreign client is back", () => foreign.get("fht/lab/head"));
  await server.command("place", "lab", "quay", "2,0");
  await until("what comes later is shown", async () =>
    (await ada.side("Places, zones, closures").textContent()).includes("place quay"),
  );
  check(await ada.page.evaluate(() => globalThis.isTheSamePage), "the page was not loaded again");
  const journal = async () => (await ada.side("Changes").getByRole("listitem").allTextContents()).join("\n");
  const isTold = async () => /operator: place quay is at 2.00,0.00, 0°\n[^\n]*ada: place gate-5 is at/.test(await journal());
  await until("a command, and what came before the restart, in the journal", isTold);
  await ada.page.reload();
  await ada.isLive();
  await until("also after a reload", isTold);
  await ada.end();
}

const HOSTILE = [
  '<img src=x onerror="globalThis.isHit=1">',
  "<script>globalThis.isHit=1</script>",
  "'\"><svg onload=isHit=1>",
  "javascript:globalThis.isHit=1",
  "{{constructor.constructor('isHit=1')()}}",
  "&lt;b&gt;",
  "‮evil",
  "__proto__",
];

// The server takes in none of them. So something else between says them, as if it did.
async function hostile_names_are_never_markup({ browser, url }) {
  const ada = await Person.at(browser, "about:blank");
  const say = async (address, alter) =>
    ada.page.route(address, async (route) => {
      try {
        const reply = await route.fetch();
        await route.fulfill({ response: reply, json: alter(await reply.json()) });
      } catch {
        // The page was left meanwhile.
      }
    });
  await say("**/fht/maps", (maps) => ({ maps: HOSTILE.map((map) => ({ ...maps.maps[0], map })), warning: HOSTILE[0] }));
  await say("**/fht/lab/rules", (rules) => ({
    ...rules,
    places: HOSTILE.map((name) => ({ name, pose: [1, 0, 0] })),
    zones: HOSTILE.map((name) => ({
      name,
      rule: "keep_out",
      corners: [
        [0, 0],
        [1, 0],
        [1, 1],
      ],
    })),
    blocked: HOSTILE.map((robot) => ({ robot, for_s: 9, places: [[1, 0]], edges: [] })),
  }));
  const status = (robot) => ({
    robot,
    role: "client",
    map: "lab",
    version: 1,
    vector: {},
    state: robot,
    release: robot,
    map_from_base: [1, 0, 0],
  });
  await say("**/fht/lab/fleet*", (fleet) => ({
    ...fleet,
    robots: HOSTILE.map((robot) => ({ status: status(robot), alive: true, seen_s: 1, behind: 0, late: false })),
  }));
  await say("**/fht/lab/releases", (releases) => ({
    ...releases,
    releases: HOSTILE.map((name) => ({ name, author: name, version: 1, available: true, enabled: false })),
  }));
  await say("**/fht/lab/journal*", (journal) => ({
    ...journal,
    entries: HOSTILE.map((name, number) => ({ at_us: 1e300, author: name, name, number, words: [name] })),
  }));
  await say("**/fht/lab/head", (head) => ({
    ...head,
    deletion: { at: HOSTILE[0], reason: HOSTILE[1], by: HOSTILE[2] },
  }));
  await say("**/api/me", (me) => ({ ...me, name: HOSTILE[0], role: HOSTILE[1] }));
  await ada.page.route("**/fht/lab/path*", (route) =>
    route.fulfill({ status: 422, json: { code: "NO_PATH", message: HOSTILE.join(" ") } }),
  );
  for (const where of ["", "#/lab", `#/${encodeURIComponent(HOSTILE[0])}`]) {
    await ada.page.goto(`${url}${where}`);
    if (where === "#/lab") {
      await until("they are shown as they are", async () => {
        const text = await ada.page.locator("main").textContent();
        return HOSTILE.every((name) => text.split(name).length > 3);
      });
      const side = ada.side("Path");
      await side.getByLabel("from").fill("a");
      await side.getByLabel("to").fill("b");
      await side.getByRole("button", { name: "Find the path" }).click();
      await until("the refusal, too", async () => (await side.textContent()).includes(HOSTILE[0]));
    } else {
      await until("the first is shown as it is", async () =>
        (await ada.page.locator("body").textContent()).includes(HOSTILE[0]),
      );
    }
    const made = await ada.page.evaluate(() => [
      globalThis.isHit,
      document.querySelectorAll("main img, main script, main svg, main b, a[href^=javascript]").length,
    ]);
    check(made[0] === undefined && made[1] === 0, `${where}: ${made}`);
    await ada.page.goto("about:blank");
  }
  await ada.end();
}

async function a_phone_and_a_wall_have_everything_in_sight({ browser, url }) {
  const sizes = [
    [
      { width: 390, height: 844 },
      { hasTouch: true, isMobile: true, deviceScaleFactor: 2 },
    ],
    [{ width: 3840, height: 2160 }, { colorScheme: "dark" }],
  ];
  for (const [viewport, more] of sizes) {
    const ada = await Person.at(browser, `${url}#/museum`, { viewport, ...more });
    await ada.isLive();
    await until("the map is there", async () => (await ada.side("Map").textContent()).includes("main"));
    const wide = await ada.page.evaluate(() => document.documentElement.scrollWidth);
    check(wide <= viewport.width, `nothing lies beside the screen: ${wide} of ${viewport.width}`);
    const canvas = await ada.page.locator("canvas").boundingBox();
    check(canvas.height > viewport.height / 2, `the map is large: ${canvas.height}`);
    if (more.hasTouch) {
      await ada.page.touchscreen.tap(canvas.x + canvas.width / 2, canvas.y + canvas.height / 2);
      await until("a finger clicks", async () => !(await ada.said).startsWith("Drag"));
    }
    await ada.isAccessible(`${viewport.width} pixels`);
    await ada.end();
  }
}

// In this order: the map grows on the way.
export default [
  two_browsers_see_each_others_changes,
  a_restarted_server_is_shown_and_heals_without_reloading,
  hostile_names_are_never_markup,
  a_phone_and_a_wall_have_everything_in_sight,
];
