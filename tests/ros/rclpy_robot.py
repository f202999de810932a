"""A robot as a real node of ROS 2 (rclpy): integrates the commands it gets, answers with pose and twist at 20 Hz.

    rclpy_robot.py LOG KIND SECONDS      KIND: Twist or TwistStamped; writes arrivals and its track as JSON to LOG

After SECONDS without a command (once there was one) it ends.
"""

import json
import math
import sys
import time
from pathlib import Path

import rclpy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from rclpy.node import Node

STEP = 0.05


class Robot(Node):
    def __init__(self, stamped):
        super().__init__("robot")
        self.stamped, self.command, self.pose = stamped, (0.0, 0.0), [0.0, 0.0, 0.0]
        self.arrivals, self.track = [], []
        self.create_subscription(TwistStamped if stamped else Twist, "/nav/cmd_vel", self.hear, 10)
        self.poses = self.create_publisher(PoseStamped, "/pose", 10)
        self.twists = self.create_publisher(TwistStamped, "/twist", 10)
        self.create_timer(STEP, self.move)

    def hear(self, message):
        twist = message.twist if self.stamped else message
        self.command = (twist.linear.x, twist.angular.z)
        self.arrivals.append((time.monotonic(), *self.command))

    def move(self):
        speed, turn = self.command
        x, y, heading = self.pose
        self.pose = [x + speed * STEP * math.cos(heading), y + speed * STEP * math.sin(heading), heading + turn * STEP]
        self.track.append((time.monotonic(), *self.pose))
        pose, twist = PoseStamped(), TwistStamped()
        pose.pose.position.x, pose.pose.position.y = self.pose[:2]
        turned = pose.pose.orientation
        turned.z, turned.w = math.sin(self.pose[2] / 2), math.cos(self.pose[2] / 2)
        twist.twist.linear.x, twist.twist.angular.z = speed, turn
        self.poses.publish(pose)
        self.twists.publish(twist)


def main():
    log, stamped, patience = Path(sys.argv[1]), sys.argv[2] == "TwistStamped", float(sys.argv[3])
    rclpy.init()
    robot = Robot(stamped)
    log.with_suffix(".ready").touch()
    end = time.monotonic() + 120
    while time.monotonic() < end:
        rclpy.spin_once(robot, timeout_sec=0.1)
        if robot.arrivals and time.monotonic() - robot.arrivals[-1][0] > patience:
            break
    log.write_text(json.dumps({"arrivals": robot.arrivals, "track": robot.track}))


if __name__ == "__main__":
    main()
