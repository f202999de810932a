"""HUSKYs in a physics engine (PyBullet) as ROS 1 robots: not a robot, but everything a robot's planner sees of one.

Each has what the thesis describes: ``nav/cmd_vel`` and, winning over it, ``cmd_vel``; ``/tf``; odometry; points of a
LIDAR with 256 rays at 10 Hz that are 0.3 s old. Its controller keeps to Clearpath's limits and stops after 0.25 s
without a command.

    husky_nodes.py LOG PLACES [WALL_X]      PLACES: JSON {role: [x, y, heading]}

On SIGTERM it writes what it saw to LOG, and how many seconds it ever was behind real time from the first command on
(before, robots stand, and planners start with all cores); a file LOG with the suffix .ready says that all are up.
"""

import json
import math
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pybullet
import rospy
from geometry_msgs.msg import TransformStamped, Twist
from husky import SCAN, STEP, Husky, open_world
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

TIMEOUT, HUMAN = 0.25, 0.5


class Robot:
    def __init__(self, role, place):
        self.role, self.husky = role, Husky(*place)
        self.command, self.heard, self.human = np.zeros(2), -math.inf, -math.inf
        self.arrivals, self.track = [], []
        rospy.Subscriber(f"/{role}/nav/cmd_vel", Twist, self.planner, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(f"/{role}/cmd_vel", Twist, self.by_hand, queue_size=1, tcp_nodelay=True)
        self.odometry = rospy.Publisher(f"/{role}/odometry/filtered", Odometry, queue_size=1)
        self.points = rospy.Publisher(f"/{role}/points_filtered", PointCloud2, queue_size=1)

    def planner(self, message):
        now = time.monotonic()
        self.arrivals.append((now, message.linear.x, message.angular.z))
        if now - self.human > HUMAN:
            self.command, self.heard = np.array([message.linear.x, message.angular.z]), now

    def by_hand(self, message):
        self.human = self.heard = time.monotonic()
        self.command = np.array([message.linear.x, message.angular.z])

    def drive(self):
        self.husky.drive(self.command if time.monotonic() - self.heard < TIMEOUT else np.zeros(2))

    def tell(self):
        place, turned, heading, forward, turn = self.husky.state()
        self.track.append((time.monotonic(), place[0], place[1], heading, forward, turn))
        stamp = rospy.Time.now()
        odometry = Odometry()
        odometry.header.stamp, odometry.header.frame_id = stamp, f"{self.role}/odom"
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = forward, turn
        self.odometry.publish(odometry)
        transform = TransformStamped()
        transform.header.stamp, transform.header.frame_id = stamp, f"{self.role}/map"
        transform.child_frame_id = f"{self.role}/base_link"
        shift, rotation = transform.transform.translation, transform.transform.rotation
        shift.x, shift.y, shift.z = place
        rotation.x, rotation.y, rotation.z, rotation.w = turned
        return transform

    def scan(self):
        points = self.husky.scan()
        if points is None:
            return
        cloud = PointCloud2()
        cloud.header.stamp, cloud.header.frame_id = rospy.Time.now(), f"{self.role}/base_link"
        cloud.height, cloud.width, cloud.point_step, cloud.row_step = 1, len(points), 12, 12 * len(points)
        cloud.fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz")]
        cloud.data = points.astype("<f4").tobytes()
        self.points.publish(cloud)


def main():
    with suppress(PermissionError):
        # The world does not wait for a processor that planners use; threads inherit this, and it takes root.
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    log, places = Path(sys.argv[1]), json.loads(sys.argv[2])
    open_world(float(sys.argv[3]) if len(sys.argv) > 3 else None)
    rospy.init_node("huskies", disable_signals=True)
    robots = [Robot(role, place) for role, place in places.items()]
    transforms = rospy.Publisher("/tf", TFMessage, queue_size=10)
    over = []
    signal.signal(signal.SIGTERM, lambda *_: over.append(True))
    log.with_suffix(".ready").touch()
    begin, step, behind = time.monotonic(), 0, 0.0
    while not over:
        for robot in robots:
            robot.drive()
        pybullet.stepSimulation()
        if step % 5 == 0:  # 48 Hz
            transforms.publish([robot.tell() for robot in robots])
        if step % SCAN == 0:
            for robot in robots:
                robot.scan()
        step += 1
        ahead = begin + step * STEP - time.monotonic()
        if any(robot.arrivals for robot in robots):
            behind = max(behind, -ahead)
        if ahead > 0:
            time.sleep(ahead)
    seen = {robot.role: {"arrivals": robot.arrivals, "track": robot.track} for robot in robots}
    log.write_text(json.dumps({"seen": seen, "behind": behind}))


if __name__ == "__main__":
    main()
