"""Where a robot of ROS 2 is and how it moves, out of its topics: odometry, stamped poses and twists, or transforms."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from mp2a.robots.frames import Found, Transforms
from mp2a.robots.interface import NO_POSE
from mp2a.robots.odometry import LastSeen, heading
from mp2a.robots.ros2.node import Node, take
from mp2a.robots.table import RobotInterface
from mp2a.spatial import Array

_NO_TWIST: Array = np.full(2, np.nan)
_TRANSFORMS = 100
"""Messages of a topic of transforms that are kept from one look to the next: several programs publish on it."""


class Motion(Protocol):
    """Pose and twist of a robot, from wherever."""

    def read(self, age: float) -> tuple[Array, Array]:
        """Newest pose ``(3,)``, m and rad, and twist ``(2,)``, m/s and rad/s; not a number if older than ``age`` s."""


class Odometries:
    """Pose and twist out of one topic of odometry."""

    def __init__(self, reader: Any) -> None:
        self._reader = reader
        self._last: LastSeen[Any] = LastSeen()

    def read(self, age: float) -> tuple[Array, Array]:
        """Newest pose ``(3,)`` and twist ``(2,)``; not a number for what is older than ``age`` s."""
        last = _newest(self._reader, self._last, age)
        return (NO_POSE, _NO_TWIST) if last is None else (_pose(last.pose.pose), _twist(last.twist.twist))


class Stamped:
    """Pose and twist out of a topic each."""

    def __init__(self, poses: Any, twists: Any) -> None:
        self._poses, self._twists = poses, twists
        self._last_pose: LastSeen[Any] = LastSeen()
        self._last_twist: LastSeen[Any] = LastSeen()

    def read(self, age: float) -> tuple[Array, Array]:
        """Newest pose ``(3,)`` and twist ``(2,)``; not a number for what is older than ``age`` s."""
        pose, twist = _newest(self._poses, self._last_pose, age), _newest(self._twists, self._last_twist, age)
        return NO_POSE if pose is None else _pose(pose.pose), _NO_TWIST if twist is None else _twist(twist.twist)


class Frames:
    """Transforms out of the topics that they come on, moving ones and fixed ones."""

    def __init__(self, node: Node, topic: str) -> None:
        from mp2a.robots.ros2.messages import TFMessage

        self._fixed = node.reader(f"{topic}_static", TFMessage, _TRANSFORMS, reliable=True, kept=True)
        self._moving = node.reader(topic, TFMessage, _TRANSFORMS)
        self._known = Transforms()

    def look_up(self, into: str, frame: str) -> Found | None:
        """Return a frame as seen from the frame ``into``, if it is known."""
        for reader, fixed in ((self._fixed, True), (self._moving, False)):
            for message in take(reader):
                for transform in message.transforms:
                    self._known.put(transform, fixed)
        return self._known.look_up(into, frame)


class Located:
    """Pose out of transforms, twist out of odometry."""

    def __init__(self, frames: Frames, fixed_frame: str, body_frame: str, odometry: Odometries) -> None:
        self._frames, self._between, self._odometry = frames, (fixed_frame, body_frame), odometry

    def read(self, age: float) -> tuple[Array, Array]:
        """Newest pose ``(3,)`` and twist ``(2,)``; not a number for what is older than ``age`` s."""
        found = self._frames.look_up(*self._between)
        _, twist = self._odometry.read(age)
        if found is None or found.age > age:
            return NO_POSE, twist
        return np.array([found.shift[0], found.shift[1], found.heading]), twist


def _newest(reader: Any, seen: LastSeen[Any], age: float) -> Any:
    """Take in what has come; returns the last message if it came at most ``age`` s ago."""
    for message in take(reader):
        seen.put(message)
    return seen.within(age)


def _pose(pose: Any) -> Array:
    """``(3,)`` m, m, rad of a ``geometry_msgs/Pose``."""
    return np.array([pose.position.x, pose.position.y, heading(pose.orientation)])


def _twist(twist: Any) -> Array:
    """``(2,)`` m/s and rad/s of a ``geometry_msgs/Twist``."""
    return np.array([twist.linear.x, twist.angular.z])


def _odometries(node: Node, interface: RobotInterface, _: Frames) -> Odometries:
    from mp2a.robots.ros2.messages import Odometry

    return Odometries(node.reader(interface.odometry_topic, Odometry))


def _stamped(node: Node, interface: RobotInterface, _: Frames) -> Stamped:
    from mp2a.robots.ros2.messages import PoseStamped, TwistStamped

    return Stamped(node.reader(interface.pose_topic, PoseStamped), node.reader(interface.twist_topic, TwistStamped))


def _located(node: Node, interface: RobotInterface, frames: Frames) -> Located:
    return Located(frames, interface.fixed_frame, interface.body_frame, _odometries(node, interface, frames))


_MOTIONS: dict[str, Callable[[Node, RobotInterface, Frames], Motion]] = {
    "odometry": _odometries,
    "stamped": _stamped,
    "tf": _located,
}


def motion(node: Node, interface: RobotInterface, frames: Frames) -> Motion:
    """Read a robot's pose and twist from where its interface says."""
    return _MOTIONS[interface.pose](node, interface, frames)
