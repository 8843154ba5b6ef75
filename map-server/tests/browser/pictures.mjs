// Pictures of each view, for docs/web.md: node pictures.mjs URL FOLDER CHROMIUM PLAN
//
// At URL there is a server with the page on which somebody may change maps, with a map `museum` of
// the built-in museum with a release `spring.1` and two places, and robots on it. The map says how
// PLAN, an image of the museum, lies in it, and where on earth it is.

import { Person, launch, until } from "./site.mjs";

const [url, folder, chromium, plan] = process.argv.slice(2);
const browser = await launch(chromium);

async function view(name, hash, options, act = async () => {}) {
  const ada = await Person.at(browser, `${url}${hash}`, { viewport: { width: 1180, height: 760 }, ...options });
  await ada.isLive();
  await ada.page.waitForTimeout(2500);
  await act(ada);
  await ada.page.waitForTimeout(1200);
  await ada.page.screenshot({ path: `${folder}/web-${name}.png` });
  await ada.end();
}

await view("list", "", { viewport: { width: 1180, height: 330 } });
await view("path", "#/museum", {}, async (ada) => {
  await ada.press("Path");
  await ada.clickAt(-2.5, 6);
  await ada.clickAt(9.5, 2.6);
});
await view("zone", "#/museum", { colorScheme: "dark" }, async (ada) => {
  await ada.press("Draw a zone");
  for (const corner of [
    [6.8, 5.7],
    [9.6, 5.7],
    [10.2, 1.5],
    [6.8, 1.5],
  ])
    await ada.clickAt(...corner);
  await ada.page.getByLabel("name of the zone").fill("stairs");
  await ada.press("What would change?");
  await until("it is told", async () =>
    (await ada.side("Places, zones, closures").textContent()).includes("would change"),
  );
});
await view("compare", "#/museum", {}, async (ada) => {
  await ada.side("Path").locator("summary").click();
  await ada.page
    .getByRole("button", { name: /^Compare: / })
    .first()
    .click();
});
await view("time", "#/museum", {}, async (ada) => {
  for (const part of ["Path", "Places, zones, closures"]) await ada.side(part).locator("summary").click();
  await ada.page.getByRole("slider").evaluate((slider) => {
    slider.value = 60;
    slider.dispatchEvent(new Event("input"));
  });
});
await view("siting", "#/museum", {}, async (ada) => {
  for (const part of ["Path", "Places, zones, closures", "Changes", "Releases", "Time", "Robots", "Map"])
    await ada.side(part).locator("summary").click();
  const side = ada.side("Floor plan");
  await side.getByLabel("image of the floor plan").setInputFiles(plan);
  await ada.page.mouse.move(...(await ada.pixelsOf(-2.5, 6)));
});
await view("journal", "#/museum", {}, async (ada) => {
  for (const part of ["Path", "Places, zones, closures"]) await ada.side(part).locator("summary").click();
});
await view("robots", "#/museum", { colorScheme: "dark" }, async (ada) => {
  for (const part of ["Path", "Places, zones, closures", "Releases", "Time"])
    await ada.side(part).locator("summary").click();
});
await view("health", "#health", { viewport: { width: 1180, height: 900 } }, (ada) => ada.page.waitForTimeout(6000));
await view("phone", "#/museum", { viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true });
await browser.close();
