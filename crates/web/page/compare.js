// What differs between two states of a map, as nodes: added, gone, moved. Pure.

const MOVED_M = 0.002; // positions are whole millimetres

// Both are maps of ids to nodes.
export function compare(before, now) {
  const found = { added: [], gone: [], moved: [] };
  for (const [id, node] of now) {
    const was = before.get(id);
    if (!was) found.added.push(node);
    else if (Math.hypot(node.x - was.x, node.y - was.y) > MOVED_M) found.moved.push([was, node]);
  }
  for (const [id, node] of before) if (!now.has(id)) found.gone.push(node);
  return found;
}

export function inWords({ added, gone, moved }) {
  const farthest = moved.reduce((most, [was, node]) => Math.max(most, Math.hypot(node.x - was.x, node.y - was.y)), 0);
  const parts = [
    [added.length, "added"],
    [gone.length, "gone"],
    [moved.length, `moved by up to ${farthest.toFixed(2)} m`],
  ];
  const said = parts
    .filter(([count]) => count)
    .map(([count, what]) => `${count} ${count === 1 ? "node" : "nodes"} ${what}`);
  return said.join(", ") || "no node is another";
}
