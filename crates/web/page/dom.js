// Elements. What comes from elsewhere (names of maps, places, robots) is text, and never markup.

const isThere = (child) => child !== null && child !== undefined;

export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && isThere(value)) made.setAttribute(name, value);
  }
  // Strings become text nodes.
  made.append(...children.flat().filter(isThere));
  return made;
}

export function fill(parent, ...children) {
  parent.replaceChildren(...children.flat().filter(isThere));
}

export function table(caption, heads, rows) {
  const pair = (value) => (Array.isArray(value) ? value : [value, ""]);
  const cell = ([content, kind]) => el("td", { class: kind || null }, content);
  return el(
    "div",
    { class: "scrolls" },
    el(
      "table",
      {},
      caption ? el("caption", {}, caption) : null,
      el(
        "thead",
        {},
        el(
          "tr",
          {},
          heads.map(pair).map(([text, kind]) => el("th", { scope: "col", class: kind || null }, text)),
        ),
      ),
      el(
        "tbody",
        {},
        rows.map((row) => el("tr", {}, row.map(pair).map(cell))),
      ),
    ),
  );
}

export function labelled(text, input) {
  return el("label", {}, text, input);
}

// A part of a page that can be folded.
export function section(title, isOpen, box) {
  return el("details", { open: isOpen }, el("summary", {}, el("h2", {}, title)), box);
}

export function copyButton(text, say) {
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
      say("the line is copied");
    } catch {
      say("this browser does not let pages copy: select the line");
    }
  };
  return el("button", { type: "button", onclick: copy }, "Copy the line");
}

export const metres = (value) => `${value.toFixed(2)} m`;

export function size(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(1)} KB`;
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(1)} GB`;
}

// What robots use of a map: the enabled release, if all of it is there.
export function inUse({ enabled, enabled_unused: isUnused }) {
  if (!enabled) return "the newest state";
  return isUnused ? `not ${enabled}, which is enabled but not whole` : enabled;
}
