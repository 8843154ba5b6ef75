// A viewer: node view.mjs URL PROTOCOL. It draws what it is told, and does what stands on standard
// input, a line of JSON each; each is answered with a line of JSON.

import protocol from "@foxglove/ws-protocol";
import { createInterface } from "node:readline";
import protobuf from "protobufjs";
import "protobufjs/ext/descriptor.js";
import WebSocket from "ws";

const [url, subprotocol] = process.argv.slice(2);
const ALL = 1; // SceneEntityDeletion.Type
const FREE = 160; // how opaque a cell is that is free
const seen = { channels: {}, counts: {}, bytes: {}, scenes: {}, frames: {}, poses: {}, grid: null, statuses: [] };
const channels = new Map(); // topic → channel
const subscribed = new Map(); // subscription → channel
const services = new Map(); // name → service
const types = new Map(); // topic → type
const calls = new Map(); // call → what its answer is given to
let nextCall = 1;

const client = new protocol.FoxgloveClient({ ws: new WebSocket(url, [subprotocol]) });
client.on("serverInfo", (info) => (seen.info = info));
client.on("status", ({ level, message }) => seen.statuses.push([level, message]));
client.on("error", (error) => (seen.error = String(error.message ?? error)));
client.on("close", () => (seen.closed = true));
client.on("advertise", (advertised) => {
  for (const channel of advertised) {
    channels.set(channel.topic, channel);
    seen.channels[channel.topic] = channel.schemaName;
    const root = protobuf.Root.fromDescriptor(Buffer.from(channel.schema, "base64"));
    types.set(channel.topic, root.lookupType(channel.schemaName));
  }
});
client.on("advertiseServices", (advertised) => {
  for (const service of advertised) services.set(service.name, service);
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, schemaName } = subscribed.get(subscriptionId);
  const message = types.get(topic).decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  if (timestamp < 1_600_000_000_000_000_000n) throw new Error(`told at ${timestamp}`);
  seen.counts[topic] = (seen.counts[topic] ?? 0) + 1;
  seen.bytes[topic] = (seen.bytes[topic] ?? 0) + data.byteLength;
  if (schemaName === "foxglove.SceneUpdate") draw(topic, message);
  else if (schemaName === "foxglove.FrameTransforms") {
    for (const { childFrameId, translation } of message.transforms) {
      seen.frames[childFrameId] = [translation.x, translation.y];
    }
  } else if (schemaName === "foxglove.PosesInFrame") {
    seen.poses[topic] = message.poses.map(({ position }) => [position.x, position.y]);
  } else if (schemaName === "foxglove.Grid") {
    const free = message.data.filter((value, index) => index % 4 === 3 && value === FREE).length;
    seen.grid = { columns: message.columnCount, free, bytes: message.data.length };
  }
});
client.on("serviceCallResponse", ({ callId, data }) => {
  const text = new TextDecoder().decode(data);
  calls.get(callId)({ reply: JSON.parse(text) });
});
client.on("serviceCallFailure", ({ callId, message }) => calls.get(callId)({ failure: message }));

function draw(topic, { deletions, entities }) {
  const scene = (seen.scenes[topic] ??= new Set());
  for (const { type, id } of deletions) type === ALL ? scene.clear() : scene.delete(id);
  for (const { frameId, id } of entities) {
    if (frameId !== "map" || !id) throw new Error(`an entity ${id} in the frame ${frameId}`);
    scene.add(id);
  }
}

const orders = {
  see: () => ({ ...seen, services: [...services.keys()], scenes: sorted() }),
  subscribe: ({ topics }) => {
    for (const topic of topics) {
      const channel = channels.get(topic);
      subscribed.set(client.subscribe(channel.id), channel);
    }
  },
  unsubscribe: ({ topic }) => {
    for (const [id, channel] of subscribed) if (channel.topic === topic) client.unsubscribe(id);
  },
  call: ({ service, request }) => {
    const { id } = services.get(service);
    const callId = nextCall++;
    const bytes = new TextEncoder().encode(JSON.stringify(request));
    const answer = new Promise((resolve) => calls.set(callId, resolve));
    client.sendServiceCallRequest({ serviceId: id, callId, encoding: "json", data: new DataView(bytes.buffer) });
    return answer;
  },
};

const sorted = () => Object.fromEntries(Object.entries(seen.scenes).map(([topic, scene]) => [topic, [...scene].sort()]));

for await (const line of createInterface({ input: process.stdin })) {
  const { order, ...more } = JSON.parse(line);
  const answer = (await orders[order](more)) ?? null;
  process.stdout.write(`${JSON.stringify(answer)}\n`);
}
client.close();
