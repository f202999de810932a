"""HUSKYs in a physics engine (PyBullet) as ROS 1 robots: not a robot, but everything a robot's planner sees of one.

Each has what the thesis describes: ``nav/cmd_vel`` and, winning over it, ``cmd_vel``; ``/tf``; odometry; points of a
LIDAR with 256 rays at 10 Hz that are 0.3 s old. Its controller keeps to Clearpath's limits and stops after 0.25 s
without a command.

    husky_nodes.py LOG PLACES [WALL_X]      PLACES: JSON {role: [x, y, heading]}

On SIGTERM it writes what it saw to LOG, and how many seconds it ever was behind real time; a file LOG with the suffix
.ready says that all are up.
"""

import json
import math
import signal
import sys
import time
from collections import deque
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
import rospy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

STEP = 1 / 240
WHEEL, TRACK = 0.17775, 0.5708 * 1.875
TIMEOUT, HUMAN = 0.25, 0.5
LIMITS, RATES = np.array([1.0, 2.0]), np.array([3.0, 6.0])
RAYS, NEAREST, FARTHEST, HEIGHT = 256, 0.62, 10.0, 0.35
LAG = 3  # scans


class Husky:
    def __init__(self, role, x, y, heading):
        self.role = role
        turned = pybullet.getQuaternionFromEuler((0, 0, heading))
        self.body = pybullet.loadURDF("husky/husky.urdf", (x, y, 0.1), turned)
        joints = [pybullet.getJointInfo(self.body, k) for k in range(pybullet.getNumJoints(self.body))]
        self.wheels = {info[1].decode(): info[0] for info in joints if b"wheel" in info[1]}
        assert len(self.wheels) == 4
        self.command, self.heard, self.human = np.zeros(2), -math.inf, -math.inf
        self.target = np.zeros(2)
        self.arrivals, self.track, self.speeds = [], [], []
        self.scans = deque()
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
        wanted = self.command if time.monotonic() - self.heard < TIMEOUT else np.zeros(2)
        step = RATES * STEP
        self.target += np.clip(np.clip(wanted, -LIMITS, LIMITS) - self.target, -step, step)
        for name, joint in self.wheels.items():
            side = -1 if "left" in name else 1
            spin = (self.target[0] + side * self.target[1] * TRACK / 2) / WHEEL
            pybullet.setJointMotorControl2(self.body, joint, pybullet.VELOCITY_CONTROL, targetVelocity=spin, force=60)

    def state(self):
        place, turned = pybullet.getBasePositionAndOrientation(self.body)
        linear, angular = pybullet.getBaseVelocity(self.body)
        heading = pybullet.getEulerFromQuaternion(turned)[2]
        forward = linear[0] * math.cos(heading) + linear[1] * math.sin(heading)
        return place, turned, heading, forward, angular[2]

    def tell(self):
        place, turned, heading, forward, turn = self.state()
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
        place, _, heading, _, _ = self.state()
        angles = heading + np.arange(RAYS) * 2 * math.pi / RAYS
        rays = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(RAYS)))
        middle = np.array([place[0], place[1], HEIGHT])
        hits = pybullet.rayTestBatch((middle + NEAREST * rays).tolist(), (middle + FARTHEST * rays).tolist())
        hit = np.array([one[3] for one in hits if one[0] >= 0]).reshape(-1, 3) - (place[0], place[1], 0)
        c, s = math.cos(heading), math.sin(heading)
        own = np.column_stack((c * hit[:, 0] + s * hit[:, 1], c * hit[:, 1] - s * hit[:, 0], hit[:, 2]))
        self.scans.append(own.astype("<f4"))
        if len(self.scans) <= LAG:
            return
        cloud = PointCloud2()
        cloud.header.stamp, cloud.header.frame_id = rospy.Time.now(), f"{self.role}/base_link"
        points = self.scans.popleft()
        cloud.height, cloud.width, cloud.point_step, cloud.row_step = 1, len(points), 12, 12 * len(points)
        cloud.fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz")]
        cloud.data = points.tobytes()
        self.points.publish(cloud)


def main():
    log, places = Path(sys.argv[1]), json.loads(sys.argv[2])
    pybullet.connect(pybullet.DIRECT)
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
    pybullet.setGravity(0, 0, -9.81)
    pybullet.loadURDF("plane.urdf")
    if len(sys.argv) > 3:
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=(0.1, 2.0, 0.5))
        pybullet.createMultiBody(0, shape, basePosition=(float(sys.argv[3]) + 0.1, 0, 0.5))
    rospy.init_node("huskies", disable_signals=True)
    huskies = [Husky(role, *place) for role, place in places.items()]
    transforms = rospy.Publisher("/tf", TFMessage, queue_size=10)
    over = []
    signal.signal(signal.SIGTERM, lambda *_: over.append(True))
    log.with_suffix(".ready").touch()
    begin, step, behind = time.monotonic(), 0, 0.0
    while not over:
        for husky in huskies:
            husky.drive()
        pybullet.stepSimulation()
        if step % 5 == 0:  # 48 Hz
            transforms.publish([husky.tell() for husky in huskies])
        if step % 24 == 0:
            for husky in huskies:
                husky.scan()
        step += 1
        ahead = begin + step * STEP - time.monotonic()
        behind = max(behind, -ahead)
        if ahead > 0:
            time.sleep(ahead)
    seen = {husky.role: {"arrivals": husky.arrivals, "track": husky.track} for husky in huskies}
    log.write_text(json.dumps({"seen": seen, "behind": behind}))


if __name__ == "__main__":
    main()
