"""Writes bags as other people's robots make them into the folder given: one idea each."""

import math
import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
FOLDER = Path(sys.argv[1])
START = 1_700_000_000_000_000_000
PERIOD = 100_000_000


def header(ns, frame):
    return T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9), frame)


def vector(x=0.0, y=0.0, z=0.0, kind="Vector3"):
    return T[f"geometry_msgs/msg/{kind}"](x, y, z)


def quaternion(roll=0.0, yaw=0.0):
    (sr, cr), (sy, cy) = [(math.sin(a / 2), math.cos(a / 2)) for a in (roll, yaw)]
    return T["geometry_msgs/msg/Quaternion"](sr * cy, sr * sy, cr * sy, cr * cy)


def scan(ns, ranges=None, frame="laser"):
    ranges = [2.0] * 181 if ranges is None else ranges
    step = math.pi / (len(ranges) - 1)
    half = math.pi / 2
    values = np.array(ranges, dtype=np.float32)
    none = np.array([], dtype=np.float32)
    return T["sensor_msgs/msg/LaserScan"](header(ns, frame), -half, half, step, 0.0, 0.1, 0.1, 10.0, values, none)


def odometry(ns, x, child="base_link", yaw=0.0):
    pose = T["geometry_msgs/msg/Pose"](vector(x, kind="Point"), quaternion(yaw=yaw))
    zeros = np.zeros(36)
    twist = T["geometry_msgs/msg/Twist"](vector(), vector())
    return T["nav_msgs/msg/Odometry"](
        header(ns, "odom"),
        child,
        T["geometry_msgs/msg/PoseWithCovariance"](pose, zeros),
        T["geometry_msgs/msg/TwistWithCovariance"](twist, zeros),
    )


def transform(ns, parent, child, x=0.0, y=0.0, roll=0.0, yaw=0.0):
    pose = T["geometry_msgs/msg/Transform"](vector(x, y), quaternion(roll, yaw))
    return T["geometry_msgs/msg/TransformStamped"](header(ns, parent), child, pose)


def transforms(*all):
    return T["tf2_msgs/msg/TFMessage"](list(all))


def picture(ns, encoding, pixel, side=4):
    data = np.array(list(pixel) * side * side, dtype=np.uint8)
    return T["sensor_msgs/msg/Image"](header(ns, "camera"), side, side, encoding, 0, side * len(pixel), data)


def text(words):
    return T["std_msgs/msg/String"](words)


def drive(frames=20, scans="/scan", odom="/odom"):
    """A robot that drives along x at 1 m/s, 10 Hz, with odometry 30 ms before and 20 ms after each scan."""
    yield "/tf_static", START, transforms(transform(START, "base_link", "laser", 0.2, 0.0))
    for k in range(frames):
        ns = START + k * PERIOD
        for late in (-30_000_000, 20_000_000):
            yield odom, ns + late, odometry(ns + late, (k * PERIOD + late) * 1e-9)
        yield scans, ns + 25_000_000, scan(ns)


def ros(name, messages, little_endian=True):
    """A rosbag2 folder, as rosbags writes it."""
    with Writer(FOLDER / name, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for topic, ns, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], ns, STORE.serialize_cdr(message, kind, little_endian=little_endian))


def plain(file, messages, compression, chunk_size=20_000):
    """An MCAP file, as the mcap package writes it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with open(file, "wb") as stream:
        writer = McapWriter(stream, compression=compression, chunk_size=chunk_size)
        writer.start(profile="ros2", library="test")
        channels = {}
        for topic, ns, message in messages:
            kind = message.__msgtype__
            if topic not in channels:
                definition, _ = STORE.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", definition.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(STORE.serialize_cdr(message, kind))
            writer.add_message(channels[topic], log_time=ns, publish_time=ns, data=data)
        writer.finish()


def with_changes(change):
    for topic, ns, message in drive():
        yield from change(topic, ns, message)


def nothing_where_nothing_returned(topic, ns, message):
    if topic == "/scan":
        message.ranges[:6] = [math.nan, math.inf, -math.inf, 0.0, 10.0, 0.05]
    yield topic, ns, message


def time_that_goes_back(topic, ns, message):
    yield topic, ns, message
    if topic == "/scan" and (ns - START) // PERIOD == 10:
        yield topic, ns, message
        yield topic, ns, scan(START)
        yield "/odom", ns, odometry(START, 0.0)


def a_gap(topic, ns, message):
    if topic != "/odom" or not 5 <= (ns - START) // PERIOD < 15:
        yield topic, ns, message


def without_transforms(topic, ns, message):
    if topic != "/tf_static":
        yield topic, ns, message


def upside_down(topic, ns, message):
    if topic == "/tf_static":
        message = transforms(
            transform(START, "base_footprint", "base_link", 0.0, 0.0, 0.0, math.pi / 2),
            transform(START, "base_link", "mast", 1.0, 0.0),
            transform(START, "mast", "laser", 0.0, 0.0, math.pi),
        )
    if topic == "/odom":
        message = odometry(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec, 0.0, "base_footprint")
    if topic == "/scan":
        message = scan(ns - 25_000_000, [1.0 + k / 90 for k in range(181)])
    yield topic, ns, message


def odometry_by_transforms(topic, ns, message):
    if topic == "/odom":
        pose = message.pose.pose
        message = transforms(
            transform(ns, "map", "odom"),
            transform(ns, "odom", "base_link", pose.position.x),
        )
        topic = "/tf"
    yield topic, ns, message


def unknown_topics(topic, ns, message):
    yield "/rosout", ns, text("hello")
    yield topic, ns, message


def other_names(topic, ns, message):
    yield {"/scan": "/front/scan", "/odom": "/wheels"}.get(topic, topic), ns, message


def two_scanners(topic, ns, message):
    if topic == "/scan":
        yield "/rear/scan", ns, message
        topic = "/front/scan"
    yield topic, ns, message


def cameras(topic, ns, message):
    if topic == "/scan" and (ns - START) // PERIOD % 2 == 0:
        for name, encoding, pixel in [
            ("front", "rgb8", (1, 2, 3)),
            ("left", "bgr8", (3, 2, 1)),
            ("back", "rgba8", (1, 2, 3, 255)),
            ("right", "mono8", (7,)),
        ]:
            yield f"/camera_{name}/image", ns + 40_000_000, picture(ns - 25_000_000 + 20_000_000, encoding, pixel)
    yield topic, ns, message


FOLDER.mkdir(parents=True, exist_ok=True)
ros("plain", drive())
ros("big_endian", drive(), little_endian=False)
plain(FOLDER / "zstd.mcap", drive(), CompressionType.ZSTD)
plain(FOLDER / "lz4.mcap", drive(), CompressionType.LZ4)
plain(FOLDER / "uncompressed.mcap", drive(), CompressionType.NONE)
every = list(drive(60))
for part in range(12):
    chosen = every[part * len(every) // 12 : (part + 1) * len(every) // 12]
    plain(FOLDER / "split" / f"split_{part}.mcap", chosen, CompressionType.LZ4)
for change in [
    nothing_where_nothing_returned,
    time_that_goes_back,
    a_gap,
    without_transforms,
    upside_down,
    odometry_by_transforms,
    unknown_topics,
    other_names,
    two_scanners,
    cameras,
]:
    ros(change.__name__, with_changes(change))
plain(FOLDER / "big.mcap", drive(3000), CompressionType.ZSTD)
whole = (FOLDER / "big.mcap").read_bytes()
(FOLDER / "cut.mcap").write_bytes(whole[: len(whole) // 2])
