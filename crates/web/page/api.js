// Questions and changes over HTTP. A refusal has a code for programs and a sentence for people.

export class Refused extends Error {
  constructor(status, code, message) {
    super(message);
    this.status = status;
    this.code = code;
  }
}

async function read(response) {
  const reply = await response.json().catch(() => ({}));
  if (response.ok) return reply;
  throw new Refused(response.status, reply.code ?? "UNKNOWN", reply.message ?? `the server answers ${response.status}`);
}

async function send(address, options) {
  let response;
  try {
    response = await fetch(address, { cache: "no-store", ...options });
  } catch {
    throw new Refused(0, "AWAY", "the server does not answer");
  }
  return read(response);
}

// The selector as Zenoh has it, with values as people write them.
export function selector(map, topic, parameters = {}) {
  const pairs = Object.entries(parameters).map(([name, value]) => `${name}=${value}`);
  return `fht/${map}/${topic}${pairs.length ? "?" : ""}${pairs.join(";")}`;
}

export function ask(map, topic, parameters = {}) {
  const encoded = Object.entries(parameters).map(([name, value]) => [name, encodeURIComponent(value)]);
  return send(`/${selector(encodeURIComponent(map), topic, Object.fromEntries(encoded))}`);
}

export const askMaps = () => send("/fht/maps");
export const askMe = () => send("/api/me");

export function askWalls(map, [x, y], radius) {
  return send(`/api/walls/${encodeURIComponent(map)}?near=${x},${y}&radius=${radius}`);
}

export function change(map, order) {
  const headers = { "Content-Type": "application/json" };
  return send(`/api/change/${encodeURIComponent(map)}`, { method: "POST", headers, body: JSON.stringify(order) });
}

// What asks the same with zenoh-cli. An apostrophe ends a shell's quotes.
export function zenohLine(asked) {
  const quoted = asked.replaceAll("'", "'\\''");
  return `zenoh --connect tcp/${location.hostname}:7447 get -s '${quoted}' --decoder json`;
}
