"""A robot over ROS 2: odometry, transforms, points, stop signals in; commands through the watchdog, or only shown."""

import math
import time
from typing import Any

from mp2a.formation.safety import from_cloud
from mp2a.robots.cloud import points as cloud_points
from mp2a.robots.interface import Sensed
from mp2a.robots.outlets import Wire, Write, outlets
from mp2a.robots.ros2.motion import Frames, motion
from mp2a.robots.ros2.node import Node, take
from mp2a.robots.sender import Sender
from mp2a.robots.table import SYNC_TOPIC, RobotInterface
from mp2a.spatial import Array


class Ros2Robot:
    """One robot over ROS 2.

    Parameters
    ----------
    role
        Of the robot.
    interface
        Topics, frames, rates.
    armed
        Whether commands are sent; if not, only shown by who watches.

    Raises
    ------
    DependencyError
        If there is no cyclonedds, or (armed) the watchdog cannot reach the robot.
    """

    def __init__(self, role: str, interface: RobotInterface, armed: bool) -> None:
        node = self._node = Node()
        from mp2a.robots.ros2.messages import Bool, PointCloud2, Twist, TwistStamped

        self._interface = interface
        self.has_lidar = bool(interface.points_topic)
        self._frames = Frames(node, interface.tf_topic)
        self._motion = motion(node, interface, self._frames)
        self._clouds = node.reader(interface.points_topic, PointCloud2) if self.has_lidar else None
        kind = Twist if interface.message == "Twist" else TwistStamped
        self._by_hand = node.reader(interface.human_topic, kind) if interface.human_topic else None
        self._human_at = -math.inf
        stops = (interface.stop_front_topic, interface.stop_rear_topic)
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
        return Sensed(pose, twist, points, human, *self._stops)

    def _points(self, cloud: Any) -> Array | None:
        """Points in the body's frame that are in the way; None if nobody knows where the sensor is."""
        points = cloud_points(cloud)
        if cloud.header.frame_id.lstrip("/") == self._interface.body_frame:
            return from_cloud(points)
        mounted = self._frames.look_up(self._interface.body_frame, cloud.header.frame_id)
        return None if mounted is None else from_cloud(mounted.apply(points))


def _wire(node: Node) -> Wire:
    from mp2a.robots.ros2.messages import Bool, Header, PointCloud2, PointField, SoundRequest, Time

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
        from mp2a.robots.ros2.messages import Bool, String

        self._text, self._bool = String, Bool
        self._writer = node.writer(SYNC_TOPIC, String)
        self._reader = node.reader(SYNC_TOPIC, String, depth=1000, reliable=True)
        self._ready = node.writer(ready_topic, Bool, kept=True)

    def publish(self, text: str) -> None:
        """Publish a text."""
        self._writer.write(self._text(text))

    def receive(self) -> list[str]:
        """Texts that have come, one's own among them."""
        return [message.data for message in take(self._reader)]

    def announce(self, ready: bool) -> None:
        """Publish on the ready topic."""
        self._ready.write(self._bool(ready))
