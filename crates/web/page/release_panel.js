// Releases: make, enable, and what differs between one and the newest state.

import { askPast } from "./api.js";
import { compare, inWords } from "./compare.js";
import { el, fill, labelled } from "./dom.js";
import { pastOf } from "./map_store.js";

export class ReleasePanel {
  constructor(box, store, { mayChange, send, say, compared }) {
    Object.assign(this, { store, mayChange, send, say, compared, against: null });
    this.list = el("div", {});
    this.answer = el("p", { role: "status" });
    this.end = el("button", { type: "button", hidden: true, onclick: () => this.compare(null) }, "End the comparison");
    fill(box, this.list, this.answer, this.end, mayChange ? this.form() : null);
  }

  form() {
    this.name = el("input", {
      required: true,
      maxlength: 64,
      autocomplete: "off",
      value: `${new Date().toISOString().slice(0, 10)}.1`,
    });
    const submit = async (event) => {
      event.preventDefault();
      const name = this.name.value.trim();
      if (await this.send({ op: "put_release", name }, `release ${name} is made`)) this.name.value = next(name);
    };
    return el(
      "form",
      { onsubmit: submit },
      labelled("name of the release", this.name),
      el("button", {}, "Make a release"),
    );
  }

  async compare(release) {
    this.against = release;
    this.end.hidden = !release;
    fill(this.answer);
    this.compared(null);
    if (!release) return;
    try {
      const past = pastOf(await askPast(this.store.map, { release }));
      if (this.against !== release) return;
      const differs = compare(past.nodes, this.store.nodes);
      fill(this.answer, `From ${release} to now: ${inWords(differs)}.`);
      this.compared(differs);
    } catch (refused) {
      this.say(refused.message, "bad");
      this.end.hidden = true;
    }
  }

  item(release) {
    const id = `${release.name}@${release.author}`;
    const button = (action, does) =>
      el("button", { type: "button", "aria-label": `${action}: ${release.name}`, onclick: does }, action);
    const enable = button("Enable", () => this.send({ op: "enable", release: id }, `robots use ${release.name}`));
    return el(
      "li",
      {},
      el(
        "span",
        {},
        `${release.name}, version ${release.version}`,
        release.enabled ? el("strong", {}, ", in use") : "",
      ),
      el(
        "span",
        { class: "actions" },
        release.available ? button("Compare", () => this.compare(id)) : "not all here",
        this.mayChange && release.available && !release.enabled ? enable : null,
      ),
    );
  }

  draw() {
    const { releases } = this.store;
    const now = JSON.stringify(releases);
    if (now === this.drawn) return;
    this.drawn = now;
    const newest = el(
      "button",
      { type: "button", onclick: () => this.send({ op: "enable", release: null }, "robots use the newest state") },
      "Enable the newest state",
    );
    const isAny = releases.some((release) => release.enabled);
    fill(
      this.list,
      el("p", { class: "soft" }, isAny ? "Robots use the release that is in use." : "Robots use the newest state."),
      releases.length
        ? el(
            "ul",
            {},
            releases.map((release) => this.item(release)),
          )
        : null,
      isAny && this.mayChange ? newest : null,
    );
  }
}

// spring.1, then spring.2.
function next(name) {
  const parts = /^(.*?)(\d+)$/.exec(name);
  return parts ? `${parts[1]}${Number(parts[2]) + 1}` : `${name}.2`;
}
