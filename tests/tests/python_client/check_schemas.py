"""Asks a running server everything, and holds what it replies against the schemas in docs/schema.

    check_schemas.py ENDPOINT MAP SCHEMA_FOLDER AUTHOR

AUTHOR is one whose increments the server will refuse. Prints the names of the schemas that something was held against.
"""
import json
import pathlib
import queue
import sys
import jsonschema
import zenoh


def main(endpoint, name, folder, author):
    schemas = {path.stem: json.loads(path.read_text()) for path in pathlib.Path(folder).glob("*.json")}
    checked = set()

    def check(schema, payload):
        validator = jsonschema.Draft202012Validator(schemas[schema])
        value = json.loads(payload.to_string())
        for error in validator.iter_errors(value):
            sys.exit(f"{schema}: {error.json_path}: {error.message}")
        # What is written is described: there is nothing that the schema does not know.
        unknown = set(value) - set(schemas[schema]["properties"])
        if unknown:
            sys.exit(f"{schema}: {unknown} is not in the schema")
        checked.add(schema)

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    with zenoh.open(config) as session:
        for schema, question in [
            ("maps", "fht/maps"),
            ("head", f"fht/{name}/head"),
            ("since", f"fht/{name}/since?fmt=json"),
            ("since", f"fht/{name}/snapshot?fmt=json;version=1"),
            ("path", f"fht/{name}/path?from=0,0;to=dock"),
            ("nodes", f"fht/{name}/nodes?near=0,0;radius=10"),
            ("releases", f"fht/{name}/releases"),
            ("diff", f"fht/{name}/diff?from=1"),
            ("rules", f"fht/{name}/rules"),
            ("fleet", f"fht/{name}/fleet"),
            ("journal", f"fht/{name}/journal"),
            ("error", f"fht/{name}/path?from=0,0"),
            ("error", f"fht/nowhere/head"),
        ]:
            count = 0
            for reply in session.get(question, timeout=10.0):
                sample = reply.err if schema == "error" else reply.ok
                if sample is None:
                    sys.exit(f"{question}: {(reply.ok or reply.err).payload.to_string()}")
                if str(sample.encoding) != "application/json":
                    sys.exit(f"{question}: a reply of encoding {sample.encoding}")
                check(schema, sample.payload)
                count += 1
            if count != 1:
                sys.exit(f"{question}: {count} replies")

        said = queue.Queue()
        session.declare_subscriber(f"fht/{name}/robots/*/*", said.put)
        session.declare_subscriber(f"fht/{name}/robots/*/goal/status", said.put)
        session.declare_subscriber(f"fht/{name}/refused/*", said.put)
        # An answer comes after the declarations before it: from here on nothing is missed.
        list(session.get(f"fht/{name}/head", timeout=10.0))
        print("listening", flush=True)
        of_robots = {"robot-pose", "robot-status", "robot-blocked", "robot-goal", "robot-goal-status"}
        while not checked >= of_robots | {"refused"}:
            sample = said.get(timeout=20.0)
            if "/refused/" in str(sample.key_expr):
                check("error", sample.payload)
                checked.add("refused")
            else:
                check("-".join(["robot", *str(sample.key_expr).split("/")[4:]]), sample.payload)
            session.put(f"fht/{name}/inc/{author}/1", b"rubbish")
    print(" ".join(sorted(checked)))


main(*sys.argv[1:5])
