"""A Zenoh client that is not ours: does what stands on standard input, a line of JSON each, and
answers each with a line of JSON."""

import json
import math
import sys
import threading
import time

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
        # Nobody sends again what is dropped on the way.
        wait = zenoh.CongestionControl.BLOCK
        session.put(order["put_bytes"], bytes.fromhex(order["bytes"]), congestion_control=wait)
    elif "swarm" in order:
        threading.Thread(target=swarm, args=(session, order), daemon=True).start()
    elif "token" in order:
        tokens[order["token"]] = session.liveliness().declare_token(order["token"])
    elif "drop" in order:
        tokens.pop(order["drop"]).undeclare()
    return {"ok": None}


def swarm(session: zenoh.Session, order: dict) -> None:
    """Robots that drive in circles and say where they are."""
    names = [f"amr-{number}" for number in range(order["robots"])]
    keys = [f"fht/{order['swarm']}/robots/{name}" for name in names]
    tokens = [session.liveliness().declare_token(key) for key in keys]
    begin, turn = time.monotonic(), 0
    while tokens and time.monotonic() < begin + order["for_s"]:
        for number, (name, key) in enumerate(zip(names, keys)):
            angle = 0.1 * turn / order["hz"] + number
            x, y = 5.0 * (number % 20) + math.cos(angle), 5.0 * (number // 20) + math.sin(angle)
            pose = {"robot": name, "localized": True, "state": "LOCALIZED", "confidence": 0.97,
                    "map_from_base": [round(x, 3), round(y, 3), round(math.remainder(angle, math.tau), 4)]}
            session.put(f"{key}/pose", json.dumps(pose))
        turn += 1
        time.sleep(max(0.0, begin + turn / order["hz"] - time.monotonic()))


main()
