"""A ROS 2 robot with rclpy, which speaks DDS: it drives along a room of 6 by 4 m without furniture,
publishes what its scanner and its wheels say, and prints the maps that it hears."""

import json
import math
import sys
import time

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

# The room's walls in the frame of the start, metres: 2 m behind it, 4 m ahead; 2 m at each side.
BEHIND, AHEAD, RIGHT, LEFT = -2.0, 4.0, -2.0, 2.0
BEAMS = 360
SPEED = 0.4
RATE = 10.0


def ranges(x, y):
    """The way to a wall in each direction, from a robot that looks along x."""
    found = []
    for beam in range(BEAMS):
        angle = -math.pi + beam * 2.0 * math.pi / BEAMS
        dx, dy = math.cos(angle), math.sin(angle)
        ways = []
        if dx:
            ways.append(((AHEAD if dx > 0 else BEHIND) - x) / dx)
        if dy:
            ways.append(((LEFT if dy > 0 else RIGHT) - y) / dy)
        found.append(min(ways))
    return found


def scan(stamp, x):
    message = LaserScan()
    message.header.stamp, message.header.frame_id = stamp, "base_link"
    message.angle_min, message.angle_increment = -math.pi, 2.0 * math.pi / BEAMS
    message.angle_max = message.angle_min + (BEAMS - 1) * message.angle_increment
    message.range_min, message.range_max = 0.05, 12.0
    message.ranges = ranges(x, 0.0)
    return message


def odometry(stamp, x, speed):
    message = Odometry()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "odom", "base_link"
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x = speed
    return message


def grid(message):
    info = message.info
    return json.dumps({
        "frame": message.header.frame_id,
        "width": info.width,
        "height": info.height,
        "resolution": info.resolution,
        "x": info.origin.position.x,
        "y": info.origin.position.y,
        "cells": list(message.data),
    })


def main():
    domain, seconds = int(sys.argv[1]), float(sys.argv[2])
    rclpy.init(domain_id=domain)
    node = rclpy.create_node("robot")
    scans = node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
    odoms = node.create_publisher(Odometry, "odom", 50)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(OccupancyGrid, "map", lambda message: print("map", grid(message), flush=True), latched)
    print("ready", flush=True)
    # It stands until somebody listens, then drives to and fro within 1.6 m.
    while scans.get_subscription_count() == 0:
        rclpy.spin_once(node, timeout_sec=0.1)
    print("heard", flush=True)
    begin, end = time.monotonic(), time.monotonic() + seconds
    while time.monotonic() < end:
        way = SPEED * (time.monotonic() - begin)
        turn, rest = divmod(way, 1.6)
        x, speed = (rest, SPEED) if turn % 2 == 0 else (1.6 - rest, -SPEED)
        stamp = node.get_clock().now().to_msg()
        odoms.publish(odometry(stamp, x, speed))
        scans.publish(scan(stamp, x))
        until = time.monotonic() + 1.0 / RATE
        while time.monotonic() < until:
            rclpy.spin_once(node, timeout_sec=max(0.0, until - time.monotonic()))
    print("silent", flush=True)
    while True:
        rclpy.spin_once(node, timeout_sec=0.5)


main()
