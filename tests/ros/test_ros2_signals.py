"""Stop signals and obstacles over DDS, between two processes that both describe their types as we do."""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from test_ros2 import OURS

from mp2a.robots.cloud import cloud_fields, read_cloud
from mp2a.robots.topics import BOOL, CLOUD

pytestmark = pytest.mark.ros
ROBOT = """
import json, time
from dataclasses import replace
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.robots_file import within
from mp2a.robots.ros_backend import open_backend
from mp2a.robots.ros_robot import RosRobot
config = within(replace(ROBOT_CONFIGS["husky"], pose="odometry"), "R1")
robot = RosRobot(open_backend("ros2", "R1"), config, None)
while True:
    sensed = robot.sense()
    seen = None if sensed.points is None else len(sensed.points)
    print(json.dumps([sensed.stop_front, sensed.stop_rear, seen]), flush=True)
    time.sleep(0.05)
"""
NEAR, FAR = np.array([[0.9, 0.1], [1.5, -1.5]]), np.array([[3.0, 0.0]])


def test_a_robot_tells_its_stop_signals_and_hears_those_of_others(monkeypatch):
    pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install 'mp2a[ros2]'")
    for name, value in (OURS | {"ROS_DOMAIN_ID": "43"}).items():
        monkeypatch.setenv(name, value)
    from mp2a.robots.ros2.node import Ros2Node

    node = Ros2Node("test")
    scan, stop = node.writer("/R1/points_filtered", CLOUD).write, node.writer("/R1/stop_rear", BOOL).write
    fronts, rears, clouds = (
        node.reader(f"/R1/{name}", kind, own=False)
        for name, kind in (("stop_front", BOOL), ("stop_rear", BOOL), ("obstacles", CLOUD))
    )
    field = node.message("sensor_msgs/msg/PointField")
    robot = subprocess.Popen([sys.executable, "-c", ROBOT], stdout=subprocess.PIPE, text=True, env=os.environ)

    def until(what, flat, rear):
        """Publish points and a stop signal until something has come."""
        deadline = time.monotonic() + 20
        heard = {"front": None, "rear": None, "cloud": None}
        while time.monotonic() < deadline:
            spatial = np.column_stack((flat, np.ones(len(flat))))  # not on the floor
            scan(*cloud_fields(spatial, node.header("R1/base_link"), field))
            stop(rear)
            sensed = json.loads(robot.stdout.readline())
            for name, take in (("front", fronts), ("rear", rears), ("cloud", clouds)):
                for _, message in take():
                    heard[name] = message
            if what(sensed, heard):
                return heard
        raise AssertionError(f"{sensed}, {heard}")

    try:
        heard = until(lambda s, h: s == [False, True, 2] and h["front"] and h["front"].data, NEAR, True)
        assert heard["rear"].data is False  # its own signal, not the one it hears
        assert heard["cloud"].header.frame_id == "R1/base_link"
        np.testing.assert_allclose(read_cloud(heard["cloud"])[:, :2], NEAR, atol=1e-6)
        until(lambda s, h: s == [False, False, 1] and h["front"] and not h["front"].data, FAR, False)
    finally:
        robot.kill()
        robot.wait()
