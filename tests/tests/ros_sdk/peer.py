"""A ROS 2 robot and its tools, with zenoh-ros2-sdk as it is: what it hears is printed, a line each.

usage: peer.py PORT TYPES.json, where TYPES.json has [definition, hash] by the type's name. Reads
commands from standard input: "silence" (no more scans), "end".
"""

import json
import math
import sys
import threading
import time

import numpy
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2ServiceServer, ROS2Subscriber
from zenoh_ros2_sdk import get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

PORT = int(sys.argv[1])
with open(sys.argv[2]) as file:
    TYPES = json.load(file)
LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
SET_BOOL = "std_srvs/srv/SetBool"


def say(*words):
    """Says a line in one piece: several threads speak."""
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


def rounded(place):
    return f"{place.x:.3f} {place.y:.3f}"


def endpoint(kind, topic, msg_type, *args, **more):
    definition, type_hash = TYPES[msg_type]
    return kind(
        topic, msg_type, *args, msg_definition=definition, type_hash=type_hash, router_port=PORT, domain_id=0, **more
    )


def service(kind, **more):
    return kind(
        service_name=more.pop("name"),
        srv_type=SET_BOOL,
        request_definition="bool data\n",
        response_definition="bool success\nstring message\n",
        type_hash=TYPES[SET_BOOL][1],
        router_port=PORT,
        domain_id=0,
        **more,
    )


chatter = endpoint(ROS2Subscriber, "/chatter", "std_msgs/msg/String", lambda message: say("chatter", message.data))
map_ = endpoint(
    ROS2Subscriber,
    "/map",
    "nav_msgs/msg/OccupancyGrid",
    lambda grid: say("map", grid.header.frame_id, grid.info.width, grid.info.height, grid.data.tolist()),
    qos=LATCHED,
)
tf = endpoint(
    ROS2Subscriber,
    "/tf",
    "tf2_msgs/msg/TFMessage",
    lambda message: [
        say("tf", one.header.frame_id, one.child_frame_id, rounded(one.transform.translation))
        for one in message.transforms
    ],
)
amcl_pose = endpoint(
    ROS2Subscriber,
    "/amcl_pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    lambda message: say(
        "amcl_pose", message.header.frame_id, rounded(message.pose.pose.position), f"{message.pose.covariance[0]:.4f}"
    ),
    qos=LATCHED,
)
cmd_vel = endpoint(
    ROS2Subscriber, "/cmd_vel", "geometry_msgs/msg/Twist", lambda twist: say("cmd_vel", twist.linear.x, twist.angular.z)
)
scan = endpoint(ROS2Publisher, "/scan", "sensor_msgs/msg/LaserScan")
odom = endpoint(ROS2Publisher, "/odom", "nav_msgs/msg/Odometry")
tf_static = endpoint(ROS2Publisher, "/tf_static", "tf2_msgs/msg/TFMessage", qos=LATCHED)
STORE = scan.session_mgr.store


def new(name, **fields):
    return STORE.types[name](**fields)


def header(stamp_ns, frame):
    stamp = new("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return new("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def rotation(yaw):
    return new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def vector(x):
    return new("geometry_msgs/msg/Vector3", x=x, y=0.0, z=0.0)


def publish(stamp_ns, is_silent):
    transform = new("geometry_msgs/msg/Transform", translation=vector(0.2), rotation=rotation(0.0))
    stamped = new(
        "geometry_msgs/msg/TransformStamped",
        header=header(stamp_ns, "base_link"),
        child_frame_id="laser",
        transform=transform,
    )
    tf_static.publish(transforms=[stamped])
    point = new("geometry_msgs/msg/Point", x=1.5, y=0.0, z=0.0)
    pose = new("geometry_msgs/msg/Pose", position=point, orientation=rotation(0.5))
    twist = new("geometry_msgs/msg/Twist", linear=vector(0.0), angular=vector(0.0))
    nothing = numpy.zeros(36)
    odom.publish(
        header=header(stamp_ns, "odom"),
        child_frame_id="base_link",
        pose=new("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=nothing),
        twist=new("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=nothing),
    )
    if not is_silent:
        scan.publish(
            header=header(stamp_ns, "laser"),
            angle_min=0.0,
            angle_max=6.2,
            angle_increment=2 * math.pi / 360,
            time_increment=0.0,
            scan_time=0.1,
            range_min=0.1,
            range_max=8.0,
            ranges=numpy.full(360, 2.5, dtype=numpy.float32),
            intensities=numpy.array([], dtype=numpy.float32),
        )


def answer(request):
    response = server.response_msg_class
    return response(success=bool(request.data), message="it is done")


server = service(ROS2ServiceServer, name="/switch", callback=answer)
client = service(ROS2ServiceClient, name="/light")
say("ready")

silent = threading.Event()
ended = threading.Event()


def obey():
    for line in sys.stdin:
        if line.strip() == "silence":
            silent.set()
        elif line.strip() == "call":
            reply = client.call(data=True)
            say("light", reply.success, reply.message)
        elif line.strip() == "list":
            found = get_topic_names_and_types(router_port=PORT, domain_id=0)
            say("topics", json.dumps(sorted(str(topic) for topic in found)))
        else:
            break
    ended.set()


threading.Thread(target=obey, daemon=True).start()
while not ended.wait(0.05):
    publish(time.time_ns(), silent.is_set())
