"""The binary form and the digest, written from docs/protocol.md alone, against a running server.

    codec.py ENDPOINT MAP AUTHOR

Decodes what the server has of the map, and checks that it says what the JSON form says, that it encodes to the same bytes,
and that the map which it adds up to has the digest in the head. Then puts an increment of AUTHOR's and waits for its
acknowledgement.
"""
import json
import struct
import sys
import time
import zlib
import blake3
import zenoh


# --- postcard -------------------------------------------------------------------------------------

class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        self.at += count
        assert self.at <= len(self.data)
        return self.data[self.at - count:self.at]

    def uint(self):
        value = shift = 0
        while True:
            byte = self.take(1)[0]
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7

    def int(self):
        return unzigzag(self.uint())

    def text(self):
        return self.take(self.uint()).decode()

    def f32(self):
        return struct.unpack("<f", self.take(4))[0]

    def option(self, read):
        return read() if self.take(1)[0] else None

    def list(self, read):
        return [read() for _ in range(self.uint())]


def zigzag(value):
    return 2 * value if value >= 0 else -2 * value - 1


def unzigzag(value):
    return value // 2 if value % 2 == 0 else -(value // 2) - 1


def uint(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes(out + bytes([value]))


def sint(value):
    return uint(zigzag(value))


def text(value):
    return uint(len(value.encode())) + value.encode()


def option(value, write):
    return b"\0" if value is None else b"\1" + write(value)


def listed(values):
    return uint(len(values)) + b"".join(values)


# --- Rice codes -----------------------------------------------------------------------------------

class Mean:
    def __init__(self, start):
        self.sum = 8 * start

    def low_bits(self):
        return max((self.sum >> 3).bit_length() - 1, 0)

    def learn(self, value):
        self.sum += min(value, 80) - (self.sum >> 3)


class Bits(list):
    def put(self, value, mean):
        low = mean.low_bits()
        quotient = value >> low
        self += [1] * min(quotient, 12)
        if quotient < 12:
            self.append(0)
        else:
            rest = quotient - 11
            self += [0] * (rest.bit_length() - 1) + [int(bit) for bit in f"{rest:b}"]
        self += [value >> at & 1 for at in reversed(range(low))]
        mean.learn(value)

    def bytes(self, least):
        bits = self + [0] * (-len(self) % 8)
        out = bytes(int("".join(map(str, bits[at:at + 8])), 2) for at in range(0, len(bits), 8))
        return out + bytes(max(least - len(out), 0))


class BitReader:
    def __init__(self, data):
        self.bits = (byte >> at & 1 for byte in data for at in reversed(range(8)))

    def number(self, count):
        value = 0
        for _ in range(count):
            value = 2 * value + next(self.bits)
        return value

    def take(self, mean):
        low, quotient = mean.low_bits(), 0
        while quotient < 12 and next(self.bits):
            quotient += 1
        if quotient == 12:
            more = 0
            while not next(self.bits):
                more += 1
            quotient = 11 + ((1 << more) | self.number(more))
        value = quotient << low | self.number(low)
        mean.learn(value)
        return value


def expected(run, before):
    last = run[-1] if run else before
    if len(run) >= 4 and 8 * abs(last - run[-4]) <= last:
        return last + int((last - run[-4]) / 3)
    if len(run) >= 2 and 8 * abs(last - run[-2]) <= last:
        return 2 * last - run[-2]
    return last


def read_ranges(step, count, stream):
    bits, lengths, differences = BitReader(stream), Mean(32), Mean(8)
    steps, is_return, before = [], True, 0
    while len(steps) < count:
        length, run = bits.take(lengths), []
        for _ in range(length):
            run.append(expected(run, before) + unzigzag(bits.take(differences)) if is_return else 0)
        if is_return and run:
            before = run[-1]
        steps += run
        is_return = not is_return
    return [step * value for value in steps]


def gcd(values):
    result = 0
    for value in values:
        while value:
            result, value = value, result % value
    return max(result, 1)


def write_ranges(ranges):
    step, bits, lengths, differences = gcd(ranges), Bits(), Mean(32), Mean(8)
    steps, at, before, is_return = [value // gcd(ranges) for value in ranges], 0, 0, True
    while at < len(steps):
        end = at
        while end < len(steps) and (steps[end] > 0) == is_return:
            end += 1
        bits.put(end - at, lengths)
        if is_return and end > at:
            for place in range(at, end):
                bits.put(zigzag(steps[place] - expected(steps[at:place], before)), differences)
            before = steps[end - 1]
        at, is_return = end, not is_return
    return step, bits.bytes((len(ranges) + 15) // 16)


# --- the parts of operations: as JSON shows them, to bytes and back -------------------------------

def fixed(value, units):
    return int(value * units + (0.5 if value >= 0 else -0.5))


def point(value):
    return sint(fixed(value[0], 1000)) + sint(fixed(value[1], 1000))


def read_point(reader):
    return [reader.int() / 1000, reader.int() / 1000]


def pose(value):
    return point(value) + sint(fixed(value[2], 10000))


def read_pose(reader):
    return read_point(reader) + [reader.int() / 10000]


def rect(value):
    return b"".join(uint(fixed(reach, 1000)) for reach in value)


def read_rect(reader):
    return [reader.uint() / 1000 for _ in range(4)]


def f32(value):
    return struct.pack("<f", value)


def descriptor(value):
    bits, mean = Bits(), Mean(8)
    for component in value["values"]:
        bits.put(zigzag(component), mean)
    stream = bits.bytes(0)
    return uint(int(value["model"], 16)) + f32(value["scale"]) + uint(len(value["values"])) + uint(len(stream)) + stream


def read_descriptor(reader):
    model, scale, count = f"{reader.uint():08x}", reader.f32(), reader.uint()
    bits, mean = BitReader(reader.take(reader.uint())), Mean(8)
    return {"model": model, "scale": scale, "values": [unzigzag(bits.take(mean)) for _ in range(count)]}


def signature(op):
    scan = op["scan"]
    step, stream = write_ranges(scan["ranges_mm"])
    return option(op["descriptor"], descriptor) + pose(scan["base_from_sensor"]) + f32(scan["angle_min"]) \
        + f32(scan["angle_increment"]) + uint(step) + uint(len(scan["ranges_mm"])) + uint(len(stream)) + stream


def read_signature(reader):
    shown = reader.option(lambda: read_descriptor(reader))
    scan = {"base_from_sensor": read_pose(reader), "angle_min": reader.f32(), "angle_increment": reader.f32()}
    step, beams = reader.uint(), reader.uint()
    return {"descriptor": shown, "scan": scan | {"ranges_mm": read_ranges(step, beams, reader.take(reader.uint()))}}


def zone(value):
    rule = b"\0" if value["rule"] == "keep_out" else b"\1" + uint(round(1000 * value["rule"]["speed_limit"]))
    return rule + listed([point(corner) for corner in value["corners"]])


def read_zone(reader):
    rule = {"speed_limit": reader.uint() / 1000} if reader.uint() else "keep_out"
    return {"rule": rule, "corners": reader.list(lambda: read_point(reader))}


def vector(value):
    return listed([uint(int(author, 16)) + uint(count) for author, count in sorted(value.items())])


def read_vector(reader):
    return {f"{author:08x}": count for author, count in reader.list(lambda: (reader.uint(), reader.uint()))}


def release(op):
    return vector(op["vector"]) + bytes.fromhex(op["digest"])


def release_id(value):
    name, author = value.split("@")
    return uint(int(author, 16)) + text(name)


def read_release_id(reader):
    author = reader.uint()
    return f"{reader.text()}@{author:08x}"


def floor_plan(value):
    return text(value["image"]) + uint(fixed(value["metres_per_pixel"], 1e6)) + pose(value["map_from_image"])


def read_floor_plan(reader):
    return {"image": reader.text(), "metres_per_pixel": reader.uint() / 1e6, "map_from_image": read_pose(reader)}


def datum(value):
    return sint(fixed(value["latitude"], 1e9)) + sint(fixed(value["longitude"], 1e9)) + sint(fixed(value["yaw"], 10000))


def read_datum(reader):
    return {"latitude": reader.int() / 1e9, "longitude": reader.int() / 1e9, "yaw": reader.int() / 10000}


def node(value):
    author, number = value.split(".")
    return int(author, 16), int(number)


def plain_node(value):
    author, number = node(value)
    return uint(author) + uint(number)


class Names:
    """Wire ids of one increment."""

    def __init__(self, author):
        self.author, self.before = int(author, 16), 0

    def write(self, value):
        author, number = node(value)
        if author != self.author:
            return uint(2 * number + 1) + uint(author)
        difference = (number - self.before + 2**31) % 2**32 - 2**31
        self.before = number
        return uint(2 * zigzag(difference))

    def read(self, reader):
        """An own id is only known when its turn comes: see `edge`."""
        first = reader.uint()
        return (f"{reader.uint():08x}.{first >> 1}", None) if first & 1 else (None, unzigzag(first >> 1))

    def resolve(self, found):
        foreign, difference = found
        if foreign is not None:
            return foreign
        self.before = (self.before + difference) % 2**32
        return f"{self.author:08x}.{self.before}"

    def read_node(self, reader):
        return self.resolve(self.read(reader))

    def edge(self, ends):
        high = self.write(ends[1])
        return self.write(ends[0]) + high

    def read_edge(self, reader):
        low, high = self.read(reader), self.read(reader)
        high = self.resolve(high)
        return [self.resolve(low), high]


NAMES = ["put_node", "remove_node", "set_pose", "set_free_space", "set_signature", "put_edge", "remove_edge", "put_model",
         "set_trust", "set_closed", "set_place", "set_zone", "put_release", "remove_release", "enable", "set_floor_plan",
         "set_datum"]
KINDS = ["main", "support"]


def model(op):
    return uint(int(op["model"], 16)) + text(op["name"]) + uint(op["dimension"]) + sint(fixed(op["match_threshold"], 1000))


def write_op(op, names):
    kind = op["op"]
    out = uint(NAMES.index(kind))
    if "id" in op:
        out += names.write(op["id"])
    if "edge" in op:
        out += names.edge(op["edge"])
    return out + {
        "put_node": lambda: uint(KINDS.index(op["kind"])) + pose(op["pose"]),
        "set_pose": lambda: pose(op["pose"]),
        "set_free_space": lambda: option(op["reach"], rect),
        "set_signature": lambda: signature(op),
        "put_model": lambda: model(op),
        "set_trust": lambda: bytes([op["percent"]]),
        "set_closed": lambda: bytes([op["closed"]]),
        "set_place": lambda: text(op["name"]) + option(op["pose"], pose),
        "set_zone": lambda: text(op["name"]) + option(op["zone"], zone),
        "put_release": lambda: text(op["name"]) + release(op),
        "remove_release": lambda: release_id(op["release"]),
        "enable": lambda: option(op["release"], release_id),
        "set_floor_plan": lambda: option(op["plan"], floor_plan),
        "set_datum": lambda: option(op["datum"], datum),
    }.get(kind, lambda: b"")()


def read_op(reader, names):
    kind = NAMES[reader.uint()]
    op = {"op": kind}
    if kind in ("put_node", "remove_node", "set_pose", "set_free_space", "set_signature", "set_trust"):
        op["id"] = names.read_node(reader)
    if kind in ("put_edge", "remove_edge", "set_closed"):
        op["edge"] = names.read_edge(reader)
    return op | {
        "put_node": lambda: {"kind": KINDS[reader.uint()], "pose": read_pose(reader)},
        "set_pose": lambda: {"pose": read_pose(reader)},
        "set_free_space": lambda: {"reach": reader.option(lambda: read_rect(reader))},
        "set_signature": lambda: read_signature(reader),
        "put_model": lambda: {"model": f"{reader.uint():08x}", "name": reader.text(), "dimension": reader.uint(),
                              "match_threshold": reader.int() / 1000},
        "set_trust": lambda: {"percent": reader.take(1)[0]},
        "set_closed": lambda: {"closed": bool(reader.take(1)[0])},
        "set_place": lambda: {"name": reader.text(), "pose": reader.option(lambda: read_pose(reader))},
        "set_zone": lambda: {"name": reader.text(), "zone": reader.option(lambda: read_zone(reader))},
        "put_release": lambda: {"name": reader.text(), "vector": read_vector(reader), "digest": reader.take(32).hex()},
        "remove_release": lambda: {"release": read_release_id(reader)},
        "enable": lambda: {"release": reader.option(lambda: read_release_id(reader))},
        "set_floor_plan": lambda: {"plan": reader.option(lambda: read_floor_plan(reader))},
        "set_datum": lambda: {"datum": reader.option(lambda: read_datum(reader))},
    }.get(kind, dict)()


# --- messages -------------------------------------------------------------------------------------

def write_increment(increment):
    names = Names(increment["author"])
    ops = [write_op(op, names) for op in increment["ops"]]
    return uint(int(increment["author"], 16)) + uint(increment["number"]) + uint(increment["hlc_us"]) + listed(ops)


def read_increment(reader):
    author, number, hlc_us = f"{reader.uint():08x}", reader.uint(), reader.uint()
    names = Names(author)
    return {"author": author, "number": number, "hlc_us": hlc_us, "ops": reader.list(lambda: read_op(reader, names))}


def seal(kind, body, version=3):
    message = b"FHT" + bytes([version, kind]) + uint(len(body)) + body
    return message + struct.pack("<I", zlib.crc32(message))


def unseal(message, kind):
    reader = Reader(message)
    assert reader.take(3) == b"FHT" and reader.take(1)[0] in (2, 3, 4) and reader.take(1)[0] == kind
    body = reader.take(reader.uint())
    assert struct.unpack("<I", reader.take(4))[0] == zlib.crc32(message[:-4]) and reader.at == len(message)
    return body


# --- digests --------------------------------------------------------------------------------------

def hashed(data):
    return blake3.blake3(data).digest()


def digest(increments):
    written = {}

    def write(thing, stamp, value):
        if thing not in written or stamp > written[thing][0]:
            written[thing] = (stamp, value)

    releases, removed_releases = {}, {}
    for increment in increments:
        for index, op in enumerate(increment["ops"]):
            stamp = (increment["hlc_us"], int(increment["author"], 16), index)
            kind = op["op"]
            if "id" in op:
                id = node(op["id"])
                for thing, value in {
                    "put_node": lambda: [("kind", uint(KINDS.index(op["kind"]))), ("pose", pose(op["pose"]))],
                    "remove_node": lambda: [("removed", b"")],
                    "set_pose": lambda: [("pose", pose(op["pose"]))],
                    "set_free_space": lambda: [("rect", option(op["reach"], rect))],
                    "set_signature": lambda: [("signature", hashed(signature(op)))],
                    "set_trust": lambda: [("trust", bytes([op["percent"]]))],
                }[kind]():
                    write((thing, id), stamp, value)
            elif kind in ("put_edge", "remove_edge"):
                write(("put", tuple(map(node, op["edge"]))), stamp, bytes([kind == "put_edge"]))
            elif kind == "set_closed":
                write(("closed", tuple(map(node, op["edge"]))), stamp, bytes([op["closed"]]))
            elif kind == "put_model":
                write(("model", int(op["model"], 16)), stamp, model(op))
            elif kind == "set_place":
                write(("place", op["name"].encode()), stamp, option(op["pose"], pose))
            elif kind == "set_zone":
                write(("zone", op["name"].encode()), stamp, option(op["zone"], zone))
            elif kind == "put_release":
                key = (stamp[1], op["name"].encode())
                put = (increment["number"], stamp, release(op))
                releases[key] = min(releases.get(key, put), put, key=lambda put: put[:2])
            elif kind == "remove_release":
                name, author = op["release"].split("@")
                key = (int(author, 16), name.encode())
                removed_releases[key] = max(removed_releases.get(key, stamp), stamp)
            elif kind == "set_floor_plan":
                write(("plan", None), stamp, option(op["plan"], floor_plan))
            elif kind == "set_datum":
                write(("datum", None), stamp, option(op["datum"], datum))
            else:
                write(("enabled", None), stamp, option(op["release"], release_id))

    def stamped(register):
        stamp, value = register
        return uint(stamp[0]) + uint(stamp[1]) + uint(stamp[2]) + value

    def things(kind):
        return sorted(key for thing, key in written if thing == kind)

    leaves = {}
    for id in sorted({key for thing, key in written if thing in ("kind", "pose", "removed", "rect", "signature", "trust")}):
        removed = written.get(("removed", id))
        counts = lambda thing: (register := written.get((thing, id))) and (not removed or register[0] > removed[0])
        parts = [option(removed, stamped)]
        parts += [option(written[(thing, id)] if counts(thing) else None, stamped)
                  for thing in ("kind", "pose", "rect", "signature", "trust")]
        leaves.setdefault((id[0], id[1] // 128), ([], []))[0].append(uint(id[1]) + b"".join(parts))
    for edge in sorted({key for thing, key in written if thing in ("put", "closed")}):
        (author, number), high = edge
        parts = option(written.get(("put", edge)), stamped) + option(written.get(("closed", edge)), stamped)
        leaves.setdefault((author, number // 128), ([], []))[1].append(uint(number) + uint(high[0]) + uint(high[1]) + parts)
    leaves = [uint(author) + uint(number) + hashed(listed(nodes) + listed(edges))
              for (author, number), (nodes, edges) in sorted(leaves.items())]
    named = lambda kind: listed([uint(len(name)) + name + stamped(written[(kind, name)]) for name in things(kind)])
    of_release = lambda key: uint(key[0]) + uint(len(key[1])) + key[1] \
        + option(releases.get(key), lambda put: uint(put[0]) + stamped(put[1:])) \
        + option(removed_releases.get(key), lambda stamp: stamped((stamp, b"")))
    annotations = listed([uint(key) + stamped(written[("model", key)]) for key in things("model")])
    annotations += named("place") + named("zone")
    annotations += listed([of_release(key) for key in sorted({*releases, *removed_releases})])
    annotations += option(written.get(("enabled", None)), stamped)
    if ("plan", None) in written or ("datum", None) in written:
        annotations += option(written.get(("plan", None)), stamped) + option(written.get(("datum", None)), stamped)
    return hashed(text("fht-map state 2") + listed(leaves) + hashed(annotations)).hex()


# --- against the server ---------------------------------------------------------------------------

def main(endpoint, name, author):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    with zenoh.open(config) as session:
        def ask(question):
            for reply in session.get(f"fht/{name}/{question}", timeout=10.0):
                return reply.ok.payload.to_bytes()

        head = json.loads(ask("head"))
        body = unseal(ask("since?max_bytes=1048576"), 6)
        reader = Reader(body)
        assert reader.list(lambda: None) == []
        increments = reader.list(lambda: read_increment(reader))
        assert reader.at == len(body)
        shown = json.loads(ask("since?max_bytes=1048576;fmt=json"))["increments"]
        for own, server in zip(increments, shown, strict=True):
            # 32-bit floats are shown in their shortest decimal form: compared as what they are.
            for op in server["ops"]:
                for part in (op.get("scan"), op.get("descriptor")):
                    for field in {"scale", "angle_min", "angle_increment"} & set(part or ()):
                        part[field] = struct.unpack("<f", f32(part[field]))[0]
            assert own == server, f"{own}\n{server}"
        assert body == b"\0" + listed([write_increment(increment) for increment in increments])
        assert digest(increments) == head["digest"], "the digest differs"
        print(f"read {len(increments)} increments", flush=True)

        known = next(op["id"] for increment in increments for op in increment["ops"] if op["op"] == "put_node")
        new = {"author": author, "number": 1, "hlc_us": head["clock_us"] + 1, "ops": [
            {"op": "put_node", "id": f"{author}.300", "kind": "support", "pose": [2.0, 0.5, -0.25]},
            {"op": "set_free_space", "id": f"{author}.300", "reach": [0.5, 0.25, 0.5, 0.25]},
            {"op": "put_edge", "edge": sorted([known, f"{author}.300"], key=node)}]}
        while head["vector"].get(author) != 1:
            session.put(f"fht/{name}/inc/{author}/1", seal(1, write_increment(new)))
            time.sleep(0.1)
            head = json.loads(ask("head"))
        assert digest([*increments, new]) == head["digest"], "the digest differs after the write"
        print("wrote 1 increment", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:4])
