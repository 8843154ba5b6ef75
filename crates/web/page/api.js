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

async function reach(address, options) {
  try {
    return await fetch(address, { cache: "no-store", ...options });
  } catch {
    throw new Refused(0, "AWAY", "the server does not answer");
  }
}

async function send(address, options) {
  return read(await reach(address, options));
}

function post(address, body) {
  const headers = { "Content-Type": "application/json" };
  return send(address, { method: "POST", headers, body: JSON.stringify(body) });
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
export const askWarnings = () => send("/api/warnings");
export const askMe = () => send("/api/me");

export function askWalls(map, [x, y], radius) {
  return send(`/api/walls/${encodeURIComponent(map)}?near=${x},${y}&radius=${radius}`);
}

// An earlier state: of a `version`, or of a `release`.
export function askPast(map, state) {
  const pairs = Object.entries(state).map(([name, value]) => `${name}=${encodeURIComponent(value)}`);
  return send(`/api/past/${encodeURIComponent(map)}?${pairs.join("&")}`);
}

export async function askFigures() {
  const response = await reach("/metrics");
  if (!response.ok) return read(response);
  return response.text();
}

export const change = (map, order) => post(`/api/change/${encodeURIComponent(map)}`, order);

// Which paths between places would be others.
export const preview = (map, order) => post(`/api/preview/${encodeURIComponent(map)}`, order);

// What asks the same with zenoh-cli. An apostrophe ends a shell's quotes. A server that listens
// everywhere is reached by the name that the page is.
export function zenohLine(asked, endpoint = "tcp/[::]:7447", host = location.hostname) {
  const reached = endpoint.replace(/^(\w+)\/(0\.0\.0\.0|\[::\]):/, `$1/${host}:`);
  const quoted = asked.replaceAll("'", "'\\''");
  return `zenoh --connect ${reached} get -s '${quoted}' --decoder json`;
}
