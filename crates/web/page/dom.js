// Elements. What comes from elsewhere (names of maps, places, robots) is text, and never markup.

export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  // Strings become text nodes.
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

export function fill(parent, ...children) {
  parent.replaceChildren(...children.flat().filter((child) => child !== null && child !== undefined));
}

export function table(caption, heads, rows) {
  const cell = (tag) => ([text, kind]) => el(tag, { class: kind }, text);
  const pair = (value) => (Array.isArray(value) ? value : [value, ""]);
  return el("table", {},
    el("caption", { class: "soft" }, caption),
    el("thead", {}, el("tr", {}, heads.map(pair).map(([text, kind]) => el("th", { scope: "col", class: kind }, text)))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map(pair).map(cell("td"))))));
}

export const metres = (value) => `${value.toFixed(2)} m`;

export function size(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(1)} KB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
