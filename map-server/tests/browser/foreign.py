"""A Zenoh client that is not ours: does what stands on standard input, a line of JSON each, and
answers each with a line of JSON."""

import json
import sys

import zenoh


def main() -> None:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    config.insert_json5("connect/timeout_ms", "-1")
    config.insert_json5("connect/retry", "{period_init_ms: 50, period_max_ms: 200}")
    config.insert_json5("scouting/multicast/enabled", "false")
    tokens = {}
    with zenoh.open(config) as session:
        for line in sys.stdin:
            print(json.dumps(carry_out(session, tokens, json.loads(line))), flush=True)


def carry_out(session: zenoh.Session, tokens: dict, order: dict) -> dict:
    if "get" in order:
        replies = session.get(order["get"], timeout=10, consolidation=zenoh.ConsolidationMode.NONE)
        for reply in replies:
            if reply.ok:
                return {"ok": json.loads(reply.ok.payload.to_string())}
            return {"refused": reply.err.payload.to_string()}
        return {"refused": "nobody answers"}
    if "put" in order:
        session.put(order["put"], json.dumps(order["value"]))
    elif "put_bytes" in order:
        session.put(order["put_bytes"], bytes.fromhex(order["bytes"]))
    elif "token" in order:
        tokens[order["token"]] = session.liveliness().declare_token(order["token"])
    elif "drop" in order:
        tokens.pop(order["drop"]).undeclare()
    return {"ok": None}


main()
