"""Reads a bag with rosbags and with mcap-ros2-support, compares the two, and prints what is in it as JSON."""

import json
import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def stamp(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def with_rosbags(path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    counts, scans, odometry, twists, statics, grids, pictures = {}, [], [], [], [], [], []
    with Reader(path) as reader:
        for connection in reader.connections:
            # The definition in the file is the type that ROS has under this name.
            for name, fields in get_types_from_msg(connection.msgdef.data, connection.msgtype).items():
                assert store.fielddefs[name][1] == fields[1], name
        qos = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
        for connection, log_time, raw in reader.messages():
            message = store.deserialize_cdr(raw, connection.msgtype)
            again = store.serialize_cdr(message, connection.msgtype)
            assert bytes(again) == bytes(raw), f"{connection.topic} is not what ROS writes"
            topic = connection.topic
            counts[topic] = counts.get(topic, 0) + 1
            if topic == "/scan":
                assert stamp(message.header) == log_time
                ranges = [None if value == float("inf") else float(value) for value in message.ranges]
                scans.append({"ns": stamp(message.header), "ranges": ranges, "max": float(message.range_max)})
            elif topic == "/odom":
                pose = message.pose.pose
                odometry.append([pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w])
                twists.append([message.twist.twist.linear.x, message.twist.twist.angular.z])
                for covariance in (message.pose.covariance, message.twist.covariance):
                    variances = [float(covariance[7 * axis]) for axis in range(6)]
                    assert all(variance > 0 for variance in variances), variances
                    assert min(variances[2:5]) >= 1e6, "z, roll and pitch are not measured"
            elif topic == "/tf_static":
                statics += [[t.header.frame_id, t.child_frame_id] for t in message.transforms]
            elif topic == "/map":
                info = message.info
                assert info.width * info.height == len(message.data)
                grids.append([info.width, info.height, int((message.data == 0).sum()), int((message.data == 100).sum())])
            elif topic.startswith("/camera"):
                assert bytes(message.data[:8]) == b"\x89PNG\r\n\x1a\n"
                pictures.append(stamp(message.header))
    return {
        "counts": counts,
        "qos": qos,
        "scans": scans[:3],
        "odometry": odometry,
        "twists": twists,
        "statics": statics,
        "grids": grids,
        "pictures": len(pictures),
    }


def with_mcap(file):
    counts, chunks, markers = {}, set(), {}
    with open(file, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        profile = reader.get_header().profile
        summary = reader.get_summary()
        schemas = {schema.name: schema.encoding for schema in summary.schemas.values()}
        chunks = sorted({index.compression for index in summary.chunk_indexes})
        encodings = sorted({channel.message_encoding for channel in summary.channels.values()})
        for _, channel, _, message in reader.iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == "/fht_map":
                markers = {m.ns: [m.type, len(m.points), m.color.r, m.color.g, m.color.b] for m in message.markers}
    return {
        "counts": counts,
        "profile": profile,
        "schemas": schemas,
        "compression": chunks,
        "encodings": encodings,
        "markers": markers,
    }


bag = Path(sys.argv[1])
file = bag if bag.is_file() else next(bag.glob("*.mcap"))
print(json.dumps({"rosbags": with_rosbags(bag), "mcap": with_mcap(file)}))
