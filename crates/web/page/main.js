// Which page is shown: `#/` is the list of maps, `#/NAME` a map, `#health` the server.

import { askMe } from "./api.js";
import { el, fill } from "./dom.js";
import { showHealth } from "./health.js";
import { showList } from "./map_list.js";
import { showMap } from "./map_page.js";

const main = document.getElementById("main");
const where = document.getElementById("where");
let end = () => {};
let turn = 0;

function whoAmI(me) {
  const may = me.rights === "change" ? "may change maps" : "may look";
  return me.name ? `${me.name} (${me.role ?? "guest"}), ${may}` : may;
}

function mapAsked() {
  try {
    return location.hash.startsWith("#/") ? decodeURIComponent(location.hash.slice(2)) : "";
  } catch {
    return "";
  }
}

// What can be a map's name: anything else there cannot be.
const NAME = /^[a-z0-9_-]{1,64}$/i;

function shows(map, me) {
  if (location.hash === "#health") return showHealth(main);
  if (!map) return showList(main);
  if (!NAME.test(map)) {
    fill(main, el("p", { class: "page bad", role: "alert" }, `there can be no map called ${map}`));
    return () => {};
  }
  return showMap(main, map, me);
}

async function show() {
  turn += 1;
  const mine = turn;
  end();
  end = () => {};
  const map = mapAsked();
  const title = location.hash === "#health" ? "Health" : map;
  where.textContent = title ? `/ ${title}` : "";
  document.title = title ? `${title} · Maps` : "Maps";
  fill(main, el("p", { class: "page soft" }, "loading …"));
  try {
    const me = await askMe();
    if (mine !== turn) return; // somebody was faster
    document.getElementById("me").textContent = whoAmI(me);
    end = shows(map, me);
  } catch (refused) {
    if (mine !== turn) return;
    fill(main, el("p", { class: "page bad", role: "alert" }, refused.message));
    // The server may come back.
    const again = setTimeout(show, 3000);
    end = () => clearTimeout(again);
  }
}

document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
addEventListener("hashchange", show);
show();
