"""A robot as a real node of ROS 2 (rclpy): integrates the commands it gets, and tells at 20 Hz where it is.

    rclpy_robot.py LOG SETTINGS

SETTINGS is JSON: ``message`` (Twist or TwistStamped), ``tells`` (odometry, stamped or tf), ``wall`` (x, m, of one that
its LIDAR sees), ``lidar`` (the frame of the points), ``blind_after`` (s after the first command: no more points),
``human`` (s after the first command: from when to when a human drives), ``channel`` (whether it listens to what robots
agree on). 2 s after the last command it ends, and writes what it heard and where it was as JSON to LOG.
"""

import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Bool, String

try:  # built by messages/build.sh
    from sound_play_msgs.msg import SoundRequest
    from tf2_msgs.msg import TFMessage
except ImportError:
    SoundRequest = TFMessage = None

STEP = 0.05
PATIENCE = 2.0
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MAP_TO_ODOM = (1.0, -2.0, 0.7)
"""m, m, rad: where the odometry began."""
LIDAR = (0.2, 0.1, 0.6, 2.0)
"""m, m, m, rad: where the sensor is on the body."""


class Robot(Node):
    def __init__(self, settings):
        super().__init__("robot")
        self.settings = settings
        self.command, self.pose = (0.0, 0.0), (0.0, 0.0, 0.0)
        self.begun = None
        self.seen = {"arrivals": [], "track": [], "human": [], "sounds": [], "sync": [], "ready": []}
        self.kind = TwistStamped if settings["message"] == "TwistStamped" else Twist
        self.create_subscription(self.kind, "nav/cmd_vel", self.hear, 10)
        self.by_hand = self.create_publisher(self.kind, "cmd_vel", 10)
        tells = settings["tells"]
        self.odometry = self.create_publisher(Odometry, "odometry/filtered", 10) if tells != "stamped" else None
        if tells == "stamped":
            self.poses = self.create_publisher(PoseStamped, "pose", 10)
            self.twists = self.create_publisher(TwistStamped, "twist", 10)
        if TFMessage is not None:
            self.frames = self.create_publisher(TFMessage, "/tf", 100)
            self.fixed_frames = self.create_publisher(TFMessage, "/tf_static", KEPT)
            mounted = transform("base_link", "lidar", LIDAR[:2], LIDAR[3], self.now())
            mounted.transform.translation.z = LIDAR[2]
            self.fixed_frames.publish(TFMessage(transforms=[mounted]))
            self.create_subscription(SoundRequest, "robotsound", self.listen, 10)
        if settings["wall"] is not None:
            self.points = self.create_publisher(PointCloud2, "points_filtered", 10)
        if settings["channel"]:
            self.create_subscription(String, "/sync", lambda m: self.seen["sync"].append(m.data), 1000)
            self.create_subscription(Bool, "all_ready", lambda m: self.seen["ready"].append(m.data), 10)
        self.create_timer(STEP, self.step)

    def now(self):
        return self.get_clock().now().to_msg()

    def hear(self, message, info):
        twist = getattr(message, "twist", message)
        # When it came, not when Python got round to it.
        came = info["received_timestamp"] * 1e-9 - time.time() + time.monotonic()
        if self.begun is None:
            self.begun = came
        self.command = (twist.linear.x, twist.angular.z)
        self.seen["arrivals"].append((came, *self.command))

    def listen(self, message):
        self.seen["sounds"].append((message.sound, message.command, message.volume, message.arg))

    def since(self):
        """Time since the first command, s."""
        return -1.0 if self.begun is None else time.monotonic() - self.begun

    def step(self):
        first, last = self.settings["human"] or (math.inf, math.inf)
        if first <= self.since() < last:
            self.drive_by_hand()
        speed, turn = self.command
        x, y, heading = self.pose
        self.pose = x + speed * STEP * math.cos(heading), y + speed * STEP * math.sin(heading), heading + turn * STEP
        self.seen["track"].append((time.monotonic(), *self.pose))
        self.tell(speed, turn)
        if self.settings["wall"] is not None and self.since() < (self.settings["blind_after"] or math.inf):
            self.points.publish(self.cloud())

    def drive_by_hand(self):
        """Go straight ahead at 0.2 m/s, as a human says, who has a mux on the robot."""
        message = self.kind()
        twist = getattr(message, "twist", message)
        twist.linear.x = 0.2
        self.by_hand.publish(message)
        self.command = (0.2, 0.0)
        self.seen["human"].append(time.monotonic())

    def tell(self, speed, turn):
        tells, now = self.settings["tells"], self.now()
        if tells == "stamped":
            pose, twist = PoseStamped(), TwistStamped()
            put(pose.pose, self.pose)
            twist.twist.linear.x, twist.twist.angular.z = speed, turn
            self.poses.publish(pose)
            self.twists.publish(twist)
            return
        message = Odometry()
        message.header.stamp, message.header.frame_id, message.child_frame_id = now, "odom", "base_link"
        message.pose.covariance[35] = message.twist.covariance[35] = 0.1
        message.twist.twist.linear.x, message.twist.twist.angular.z = speed, turn
        if tells == "odometry":
            put(message.pose.pose, self.pose)
        else:  # what odometry says of the pose is of no use then
            put(message.pose.pose, (math.nan, math.nan, 0.0))
            moved = transform("odom", "base_link", self.pose[:2], self.pose[2], now)
            begun = transform("map", "odom", MAP_TO_ODOM[:2], MAP_TO_ODOM[2], now)
            self.frames.publish(TFMessage(transforms=[moved]))
            self.frames.publish(TFMessage(transforms=[begun]))
        self.odometry.publish(message)

    def cloud(self):
        """Points of a wall across its way, as its LIDAR has them."""
        x, y, heading = self.pose
        y_wall, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-2, 2, 41), np.linspace(0.1, 1.0, 10)))
        points = turned(np.stack((self.settings["wall"] - x + 0 * y_wall, y_wall - y, z), axis=1), -heading)
        if self.settings["lidar"] == "lidar":
            points = turned(points - LIDAR[:3], -LIDAR[3])
        message = PointCloud2(height=1, width=len(points), point_step=16, row_step=16 * len(points), is_dense=True)
        message.header.stamp, message.header.frame_id = self.now(), self.settings["lidar"]
        message.fields = [PointField(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("xyz")]
        rows = np.zeros((len(points), 4), np.float32)
        rows[:, :3] = points
        message.data = rows.tobytes()
        return message


def turned(points, angle):
    """Points turned about the vertical."""
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def put(message, pose):
    message.position.x, message.position.y = pose[:2]
    message.orientation.z, message.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)


def transform(parent, child, place, heading, stamp):
    message = TransformStamped(child_frame_id=child)
    message.header.stamp, message.header.frame_id = stamp, parent
    message.transform.translation.x, message.transform.translation.y = map(float, place)
    message.transform.rotation.z, message.transform.rotation.w = math.sin(heading / 2), math.cos(heading / 2)
    return message


def main():
    log, settings = Path(sys.argv[1]), json.loads(sys.argv[2])
    rclpy.init(args=sys.argv)
    robot = Robot(settings)
    log.with_suffix(".ready").touch()
    end = time.monotonic() + 120
    while time.monotonic() < end:
        rclpy.spin_once(robot, timeout_sec=0.1)
        arrivals = robot.seen["arrivals"]
        if arrivals and time.monotonic() - max(arrivals[-1][0], *robot.seen["human"][-1:], 0.0) > PATIENCE:
            break
    log.write_text(json.dumps(robot.seen))


if __name__ == "__main__":
    main()
