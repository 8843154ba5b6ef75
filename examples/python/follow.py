#!/usr/bin/env python3
"""Follows a map, asks for a path and watches robots.

    pip install eclipse-zenoh
    examples/python/follow.py 127.0.0.1:7447 museum 0,0 dock

With --report at the end it also reports the map's first edge as blocked, for 30 seconds.

docs/protocol.md says what the keys, parameters and replies mean.
"""
import json
import queue
import sys
import time
try:
    import zenoh
except ImportError as error:
    sys.exit(f"follow.py: {error}; the package of Zenoh is missing: pip install eclipse-zenoh")

# The fields of a node or an edge that each operation writes. Of all that was written to a field,
# the newest counts.
WRITES = {"put_node": ["kind", "pose"], "set_pose": ["pose"], "set_free_space": ["reach"],
          "remove_node": ["removed"], "put_edge": ["is_put"], "remove_edge": ["is_put"]}


class Map:
    """A copy of a map that is kept up with the server."""

    def __init__(self, session, name):
        self.session, self.name, self.vector, self.fields = session, name, {}, {}

    def ask(self, question):
        refusal = "no map-server answered"
        for _ in range(3):  # a busy network loses a message now and then
            # Replies as they come: Zenoh else holds them until the end of the query is here.
            replies = self.session.get(f"fht/{self.name}/{question}", timeout=5.0,
                                       consolidation=zenoh.ConsolidationMode.NONE)
            for reply in replies:
                if reply.ok is not None:
                    return json.loads(reply.ok.payload.to_string())
                refusal = reply.err.payload.to_string()
            if refusal.startswith("{"):
                break  # the server's own word
        raise RuntimeError(refusal)

    def catch_up(self):
        while True:
            have = ",".join(f"{author}:{count}" for author, count in self.vector.items())
            part = self.ask(f"since?fmt=json;vector={have}")
            if not part["compacted"] and not part["increments"]:
                return
            for series in part["compacted"]:
                for increment in series["increments"]:
                    self.apply(series["author"], increment)
                self.vector[series["author"]] = series["last"]
            for increment in part["increments"]:
                self.apply(increment["author"], increment)
                self.vector[increment["author"]] = increment["number"]

    def apply(self, author, increment):
        for place, op in enumerate(increment["ops"]):
            stamp = (increment["hlc_us"], author, op.get("index", place))
            element = self.fields.setdefault(op.get("id") or tuple(op.get("edge", ())), {})
            for field in WRITES.get(op["op"], []):
                if stamp > element.get(field, ((), None))[0]:
                    element[field] = (stamp, op.get(field, op["op"] == "put_edge"))

    def nodes(self):
        shown = lambda node: node.get("kind", ((),))[0] > node.get("removed", ((),))[0]
        return [id for id, node in self.fields.items() if isinstance(id, str) and shown(node)]

    def edges(self):
        nodes = set(self.nodes())
        put = [ends for ends, edge in self.fields.items() if edge.get("is_put", (0, False))[1]]
        return sorted(ends for ends in put if nodes.issuperset(ends))


def main(endpoint, name, start, goal, reports):
    if "/" not in endpoint:
        endpoint = f"tcp/{endpoint}"
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    events = queue.Queue()  # what comes while something else is done
    listen = lambda kind: lambda sample: events.put((kind, sample))
    with zenoh.open(config) as session:
        session.declare_subscriber(f"fht/{name}/head", listen("head"))
        session.declare_subscriber(f"fht/{name}/robots/*/pose", listen("pose"))
        robots = f"fht/{name}/robots/*"
        session.liveliness().declare_subscriber(robots, listen("token"), history=True)

        copy = Map(session, name)
        copy.catch_up()
        print(f"{len(copy.nodes())} nodes, {len(copy.edges())} edges")
        print("path:", json.dumps(copy.ask(f"path?from={start};to={goal}")["waypoints"]))
        if reports:
            report = json.dumps({"for_s": 30, "edges": copy.edges()[:1]})
            session.put(f"fht/{name}/robots/follow-py/blocked", report, encoding="application/json")
        print("blocked:", json.dumps(copy.ask("rules")["blocked"]), flush=True)
        looked = time.monotonic()
        while True:
            try:
                kind, sample = events.get(timeout=0.5)
            except queue.Empty:
                kind, sample = None, None
            # The news may be lost, or the server have begun anew: look every two seconds, too.
            if kind == "head" or time.monotonic() > looked + 2:
                before, looked = dict(copy.vector), time.monotonic()
                try:
                    copy.catch_up()
                except RuntimeError as error:
                    print(f"waiting: {error}", file=sys.stderr)
                if copy.vector != before:
                    print(f"{len(copy.nodes())} nodes, {len(copy.edges())} edges")
            if kind in ("head", None):
                pass
            elif kind == "pose":
                print("pose:", sample.payload.to_string())
            else:
                is_here = sample.kind == zenoh.SampleKind.PUT
                print(sample.key_expr, "is here" if is_here else "has gone")
            sys.stdout.flush()


if __name__ == "__main__":
    if sys.argv[1:] in (["--help"], ["-h"]):
        sys.exit(print(__doc__))
    reports = sys.argv[5:] == ["--report"]
    if len(sys.argv) != 5 + reports:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    try:
        main(*sys.argv[1:5], reports)
    except KeyboardInterrupt:
        pass
    except (RuntimeError, zenoh.ZError) as error:
        # Zenoh's errors end with a place in its source.
        sys.exit(f"follow.py: {str(error).split(' at /')[0]}")
