"""HUSKYs in a physics engine (PyBullet): Clearpath's model, wheels, friction, contacts, and a LIDAR that is late."""

import math
from collections import deque

import numpy as np
import pybullet
import pybullet_data

STEP = 1 / 240
SCAN = 24
"""Steps from one scan to the next: 10 Hz."""
WHEEL, TRACK = 0.17775, 0.5708 * 1.875
LIMITS, RATES = np.array([1.0, 2.0]), np.array([3.0, 6.0])
RAYS, NEAREST, FARTHEST, HEIGHT = 256, 0.62, 10.0, 0.35
LAG = 3  # scans


def open_world(wall=None):
    """Begin anew: a floor, and a wall of 4 m across x = ``wall``."""
    if not pybullet.isConnected():
        pybullet.connect(pybullet.DIRECT)
    pybullet.resetSimulation()
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
    pybullet.setGravity(0, 0, -9.81)
    pybullet.loadURDF("plane.urdf")
    if wall is not None:
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=(0.1, 2.0, 0.5))
        pybullet.createMultiBody(0, shape, basePosition=(wall + 0.1, 0, 0.5))


class Husky:
    """One of them; its controller keeps to Clearpath's limits."""

    def __init__(self, x, y, heading):
        turned = pybullet.getQuaternionFromEuler((0, 0, heading))
        self._body = pybullet.loadURDF("husky/husky.urdf", (x, y, 0.1), turned)
        joints = [pybullet.getJointInfo(self._body, k) for k in range(pybullet.getNumJoints(self._body))]
        self._wheels = {info[1].decode(): info[0] for info in joints if b"wheel" in info[1]}
        assert len(self._wheels) == 4
        self._target = np.zeros(2)
        self._scans = deque()

    def drive(self, wanted):
        """Turn the wheels for a step, towards a speed and a turn rate."""
        step = RATES * STEP
        self._target += np.clip(np.clip(wanted, -LIMITS, LIMITS) - self._target, -step, step)
        for name, joint in self._wheels.items():
            side = -1 if "left" in name else 1
            spin = (self._target[0] + side * self._target[1] * TRACK / 2) / WHEEL
            pybullet.setJointMotorControl2(self._body, joint, pybullet.VELOCITY_CONTROL, targetVelocity=spin, force=60)

    def state(self):
        """Place, quaternion, heading, forward speed and turn rate."""
        place, turned = pybullet.getBasePositionAndOrientation(self._body)
        linear, angular = pybullet.getBaseVelocity(self._body)
        heading = pybullet.getEulerFromQuaternion(turned)[2]
        forward = linear[0] * math.cos(heading) + linear[1] * math.sin(heading)
        return place, turned, heading, forward, angular[2]

    def scan(self):
        """Points ``(k, 3)`` in the body's frame, 0.3 s old; None before there are any."""
        place, _, heading, _, _ = self.state()
        angles = heading + np.arange(RAYS) * 2 * math.pi / RAYS
        rays = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(RAYS)))
        middle = np.array([place[0], place[1], HEIGHT])
        hits = pybullet.rayTestBatch((middle + NEAREST * rays).tolist(), (middle + FARTHEST * rays).tolist())
        hit = np.array([one[3] for one in hits if one[0] >= 0]).reshape(-1, 3) - (place[0], place[1], 0)
        c, s = math.cos(heading), math.sin(heading)
        self._scans.append(np.column_stack((c * hit[:, 0] + s * hit[:, 1], c * hit[:, 1] - s * hit[:, 0], hit[:, 2])))
        return self._scans.popleft() if len(self._scans) > LAG else None
