"""A robot over ROS 2: odometry, points and stop signals in; commands through the watchdog, or only shown.

The pose is that of ``nav_msgs/Odometry`` or of messages of its own; transforms are not looked up here. With ROS 2
Kilted's Fast DDS 3, messages that hold arrays or sequences (odometry, points) do not reach Cyclone DDS, which finds
their type descriptions invalid; ``pose = "stamped"`` is for such robots.
"""

import math
import time
from typing import Any

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography.obstacles import from_cloud
from mp2a.robots.cloud import points as cloud_points
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.odometry import LastSeen, heading
from mp2a.robots.outlets import Wire, Write, outlets
from mp2a.robots.ros2_node import Node, take
from mp2a.robots.sender import Sender
from mp2a.robots.table import SYNC_TOPIC, RobotInterface
from mp2a.spatial import Array


class Odometries:
    """Pose and twist out of one topic of odometry."""

    def __init__(self, reader: Any) -> None:
        self._reader = reader
        self._last: LastSeen[Any] = LastSeen()

    def read(self, age: float) -> tuple[Any, Any]:
        """Newest pose and twist; None for what is older than ``age`` s."""
        for message in take(self._reader):
            self._last.put(message)
        last = self._last.within(age)
        return (None, None) if last is None else (last.pose.pose, last.twist.twist)


class Stamped:
    """Pose and twist out of a topic each."""

    def __init__(self, poses: Any, twists: Any) -> None:
        self._readers = poses, twists
        self._last: tuple[LastSeen[Any], LastSeen[Any]] = LastSeen(), LastSeen()

    def read(self, age: float) -> tuple[Any, Any]:
        """Newest pose and twist; None for what is older than ``age`` s."""
        for reader, seen in zip(self._readers, self._last, strict=True):
            for message in take(reader):
                seen.put(message)
        pose, twist = (seen.within(age) for seen in self._last)
        return None if pose is None else pose.pose, None if twist is None else twist.twist


class Ros2Robot:
    """One robot over ROS 2.

    Parameters
    ----------
    role
        Of the robot.
    interface
        Topics, frames, rates; its pose must be from odometry.
    armed
        Whether commands are sent; if not, only shown by who watches.

    Raises
    ------
    InputError
        If the pose is to come from transforms.
    MissingError
        If there is no cyclonedds, or (armed) the watchdog cannot reach the robot.
    """

    def __init__(self, role: str, interface: RobotInterface, armed: bool) -> None:
        if interface.pose == "tf":
            raise InputError(f"pose: got tf for {role}, expected odometry or stamped, for ROS 2 is used without tf")
        node = self._node = Node()
        from mp2a.robots.ros2_messages import Bool, Odometry, PointCloud2, PoseStamped, Twist, TwistStamped

        self._interface = interface
        self.has_lidar = bool(interface.points_topic)
        if interface.pose == "odometry":
            self._motion: Odometries | Stamped = Odometries(node.reader(interface.odometry_topic, Odometry))
        else:
            poses = node.reader(interface.pose_topic, PoseStamped)
            self._motion = Stamped(poses, node.reader(interface.twist_topic, TwistStamped))
        self._clouds = node.reader(interface.points_topic, PointCloud2) if self.has_lidar else None
        kind = Twist if interface.message == "Twist" else TwistStamped
        self._by_hand = node.reader(interface.human_topic, kind) if interface.human_topic else None
        self._human_at = -math.inf
        stops = (interface.beside_ready(topic) for topic in (interface.stop_front_topic, interface.stop_rear_topic))
        self._stop_readers = [node.reader(topic, Bool, own=False) if topic else None for topic in stops]
        self._stops = [False, False]
        sender = Sender(interface, "ros2", role=role) if armed else None
        self.send, self.warn, self.close, self._show = outlets(interface, _wire(node), sender)

    def sense(self) -> Sensed:
        """Tell what has come last; odometry older than it may be counts as lost."""
        now = time.monotonic()
        if self._by_hand is not None and take(self._by_hand):
            self._human_at = now
        human = now - self._human_at < self._interface.human_pause
        clouds = [] if self._clouds is None else take(self._clouds)
        points = self._points(clouds[-1]) if clouds else None
        if points is not None:
            self._show(points)
        for i, reader in enumerate(self._stop_readers):
            for message in () if reader is None else take(reader):
                self._stops[i] = message.data
        pose, twist = self._motion.read(self._interface.pose_age)
        place, speeds = NO_POSE, np.full(2, np.nan)
        if pose is not None:
            place = np.array([pose.position.x, pose.position.y, heading(pose.orientation)])
        if twist is not None:
            speeds = np.array([twist.linear.x, twist.angular.z])
        return Sensed(place, speeds, points, human, *self._stops)

    def _points(self, cloud: Any) -> Array | None:
        """Points that are in the way; None if they are not in the body's frame, for nobody can tell where they are."""
        if cloud.header.frame_id.lstrip("/") != self._interface.body_frame:
            return None
        return from_cloud(cloud_points(cloud))


def _wire(node: Node) -> Wire:
    from mp2a.robots.ros2_messages import Bool, Header, PointCloud2, PointField, SoundRequest, Time

    def writer(topic: str, kind: Any) -> Write:
        opened = node.writer(topic, kind)
        return lambda *content: opened.write(kind(*content))

    def header(frame: str) -> Header:
        return Header(Time(*divmod(time.time_ns(), 1_000_000_000)), frame)

    return Wire(writer, header, Bool, SoundRequest, PointCloud2, PointField)


class Ros2Channel:
    """Texts between robots on the topic ``/sync``; ``/all_ready`` for this robot's own programs.

    Parameters
    ----------
    ready_topic
        Where to tell them that all are ready.
    """

    def __init__(self, ready_topic: str) -> None:
        node = self._node = Node()
        from mp2a.robots.ros2_messages import Bool, String

        self._text, self._bool = String, Bool
        self._writer = node.writer(SYNC_TOPIC, String)
        self._reader = node.reader(SYNC_TOPIC, String, depth=1000, reliable=True)
        self._ready = node.writer(ready_topic, Bool)

    def publish(self, text: str) -> None:
        """Publish a text."""
        self._writer.write(self._text(text))

    def receive(self) -> list[str]:
        """Texts that have come, one's own among them."""
        return [message.data for message in take(self._reader)]

    def announce(self, ready: bool) -> None:
        """Publish on the ready topic."""
        self._ready.write(self._bool(ready))
