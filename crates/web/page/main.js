// Which page is shown: `#/` is the list of maps, `#/NAME` a map.

import { askMe } from "./api.js";
import { el, fill } from "./dom.js";
import { showList } from "./map_list.js";
import { showMap } from "./map_page.js";

const main = document.getElementById("main");
const where = document.getElementById("where");
let end = () => {};

function whoAmI(me) {
  const may = me.rights === "change" ? "may change maps" : "may look";
  return me.name ? `${me.role ?? ""} ${me.name}, ${may}` : may;
}

function mapAsked() {
  try {
    return location.hash.startsWith("#/") ? decodeURIComponent(location.hash.slice(2)) : "";
  } catch {
    return "";
  }
}

async function show() {
  end();
  end = () => {};
  const map = mapAsked();
  where.textContent = map ? `/ ${map}` : "";
  document.title = map ? `${map} · Maps` : "Maps";
  fill(main, el("p", { class: "page soft" }, "loading …"));
  try {
    const me = await askMe();
    document.getElementById("me").textContent = whoAmI(me);
    end = map ? showMap(main, map, me) : showList(main);
  } catch (refused) {
    fill(main, el("p", { class: "page bad", role: "alert" }, refused.message));
    // The server may come back.
    const again = setTimeout(show, 3000);
    end = () => clearTimeout(again);
  }
}

// The link to the content changes the address, too.
addEventListener("hashchange", () => location.hash === "#main" || show());
show();
