// Who changed what, and when: what the server knows of it, whoever changed it and however.

import { el, fill } from "./dom.js";

export class JournalPanel {
  constructor(box, store) {
    Object.assign(this, { store });
    this.list = el("ul", { "aria-label": "What operators changed" });
    this.none = el("p", { class: "soft" }, "nobody is known to have changed anything");
    this.more = el("button", { type: "button", onclick: () => store.showMoreJournal() }, "Show older changes");
    fill(box, this.none, this.list, this.more);
  }

  draw() {
    const { entries, next } = this.store.journal;
    // What is drawn anew loses the focus: only when it is another.
    const now = JSON.stringify([entries, next]);
    if (now === this.drawn) return;
    this.drawn = now;
    this.none.hidden = entries.length > 0;
    this.more.hidden = !next || !this.store.mayShowMore();
    fill(this.list, entries.map(item));
  }
}

function item({ at_us: at, author, name, words, folded }) {
  const when = new Date(at / 1000);
  // A clock may have been wrong beyond all calendars.
  const isTime = !Number.isNaN(when.getTime());
  return el(
    "li",
    {},
    el(
      "span",
      {},
      isTime ? el("time", { datetime: when.toISOString(), class: "soft" }, when.toLocaleString()) : null,
      ` ${name ?? author}: ${words.join("; ")}`,
      folded ? el("span", { class: "soft" }, " (folded: what is left of it)") : null,
    ),
  );
}
