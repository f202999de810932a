"""A robot over ROS 1: odometry, transforms, points and stop signals in; commands through the watchdog, or only shown.

rospy comes with a ROS installation (Debian: ``ros-core`` and its message packages), not from the package index.
"""

import math
import threading
from typing import Any

import numpy as np

from mp2a.exceptions import DependencyError, InputError
from mp2a.formation.safety import from_cloud
from mp2a.robots.cloud import points as cloud_points
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.odometry import LastSeen, heading, rotation
from mp2a.robots.outlets import Wire, outlets
from mp2a.robots.ros1.node import NO_ROS, connect, sound_request
from mp2a.robots.sender import Sender
from mp2a.robots.table import SYNC_TOPIC, RobotInterface
from mp2a.spatial import Array

_TF_KEPT = 10.0
"""s of transforms that are remembered."""


class Ros1Robot:
    """One robot over ROS 1.

    Parameters
    ----------
    role
        Of the robot; names the node.
    interface
        Topics, frames, rates.
    armed
        Whether commands are sent; if not, only shown by who watches.

    Raises
    ------
    InputError
        If the pose is to come from stamped messages.
    DependencyError
        If there is no rospy, no master, or (armed) the watchdog cannot reach the robot.
    """

    def __init__(self, role: str, interface: RobotInterface, armed: bool) -> None:
        if interface.pose == "stamped":
            raise InputError(f"pose: got stamped for {role}, expected tf or odometry with ROS 1")
        rospy = self._rospy = connect(role)
        from geometry_msgs.msg import Twist, TwistStamped
        from nav_msgs.msg import Odometry
        from sensor_msgs.msg import PointCloud2

        self._interface = interface
        self.has_lidar = bool(interface.points_topic)
        self._odometry: LastSeen[Any] = LastSeen()
        self._cloud: LastSeen[Any] = LastSeen()
        self._human: LastSeen[Any] = LastSeen()
        rospy.Subscriber(interface.odometry_topic, Odometry, self._odometry.put, queue_size=1, tcp_nodelay=True)
        if self.has_lidar:
            rospy.Subscriber(interface.points_topic, PointCloud2, self._cloud.put, queue_size=1, buff_size=1 << 24)
        if interface.human_topic:
            kind = Twist if interface.message == "Twist" else TwistStamped
            rospy.Subscriber(interface.human_topic, kind, self._human.put, queue_size=1)
        self._stops = [self._stop_signals(topic) for topic in (interface.stop_front_topic, interface.stop_rear_topic)]
        self._tf = self._transforms()
        sender = Sender(interface, "ros1", role=role) if armed else None
        self.send, self.warn, self.close, self._show = outlets(interface, _wire(rospy), sender)

    def sense(self) -> Sensed:
        """Tell what has come last; a pose or odometry older than it may be counts as lost."""
        age = self._interface.pose_age
        odometry = self._odometry.within(age)
        twist = np.full(2, np.nan)
        if odometry is not None:
            twist = np.array([odometry.twist.twist.linear.x, odometry.twist.twist.angular.z])
        cloud = self._cloud.take()
        points = None if cloud is None else self._points(cloud)
        if points is not None:
            self._show(points)
        human = self._human.within(self._interface.human_pause) is not None
        stops = (bool(seen.within(math.inf)) for seen in self._stops)
        return Sensed(self._pose(odometry), twist, points, human, *stops)

    def _stop_signals(self, topic: str) -> LastSeen[bool]:
        """Listen to what other programs say on a topic of stop signals; it holds until they say otherwise."""
        from std_msgs.msg import Bool

        seen: LastSeen[bool] = LastSeen()
        own = self._rospy.get_name()

        def hear(message: Any) -> None:
            if message._connection_header["callerid"] != own:
                seen.put(message.data)

        if topic:
            self._rospy.Subscriber(topic, Bool, hear, queue_size=10, tcp_nodelay=True)
        return seen

    def _transforms(self) -> Any:
        try:
            import tf2_ros
        except ImportError as error:
            if self._interface.pose != "tf":
                return None
            raise DependencyError(NO_ROS.format(why=f"{error}")) from error
        buffer = tf2_ros.Buffer(self._rospy.Duration(_TF_KEPT))
        self._listener = tf2_ros.TransformListener(buffer)
        return buffer

    def _look_up(self, into: str, frame: str) -> Any:
        """Newest transform, or None if there is none."""
        import tf2_ros

        try:
            return self._tf.lookup_transform(into, frame, self._rospy.Time(0))
        except tf2_ros.TransformException:
            return None

    def _pose(self, odometry: Any) -> Array:
        if self._interface.pose == "odometry":
            if odometry is None:
                return NO_POSE
            place, turned = odometry.pose.pose.position, odometry.pose.pose.orientation
            return np.array([place.x, place.y, heading(turned)])
        found = self._look_up(self._interface.fixed_frame, self._interface.body_frame)
        # tf2 gives the newest it has, however old: a transform that nobody publishes any more is none.
        if found is None or (self._rospy.Time.now() - found.header.stamp).to_sec() > self._interface.pose_age:
            return NO_POSE
        place, turned = found.transform.translation, found.transform.rotation
        return np.array([place.x, place.y, heading(turned)])

    def _points(self, cloud: Any) -> Array | None:
        """Points in the body's frame that are in the way; None if nobody knows where the sensor is."""
        found = cloud_points(cloud)
        if cloud.header.frame_id.lstrip("/") != self._interface.body_frame:
            mounted = None if self._tf is None else self._look_up(self._interface.body_frame, cloud.header.frame_id)
            if mounted is None:
                return None
            shift, turned = mounted.transform.translation, mounted.transform.rotation
            found = found @ rotation(turned).T + (shift.x, shift.y, shift.z)
        return from_cloud(found)


def _wire(rospy: Any) -> Wire:
    from sensor_msgs.msg import PointCloud2, PointField
    from std_msgs.msg import Bool, Header

    return Wire(
        lambda topic, kind: rospy.Publisher(topic, kind, queue_size=10).publish,
        lambda frame: Header(0, rospy.Time.now(), frame),
        Bool, sound_request(), PointCloud2, PointField,
    )  # fmt: skip


class Ros1Channel:
    """Texts between robots on the topic ``/sync``; ``/all_ready`` in the robot's own namespace.

    Parameters
    ----------
    role
        Of this robot; names the node.
    ready_topic
        Where to tell this robot's own programs that all are ready.
    """

    def __init__(self, role: str, ready_topic: str) -> None:
        rospy = connect(role)
        from std_msgs.msg import Bool, String

        self._heard: list[str] = []
        self._lock = threading.Lock()
        self._publisher = rospy.Publisher(SYNC_TOPIC, String, queue_size=100)
        self._ready = rospy.Publisher(ready_topic, Bool, queue_size=1, latch=True)
        rospy.Subscriber(SYNC_TOPIC, String, self._hear, queue_size=1000)

    def publish(self, text: str) -> None:
        """Publish a text."""
        self._publisher.publish(text)

    def receive(self) -> list[str]:
        """Texts that have come, one's own among them."""
        with self._lock:
            heard, self._heard = self._heard, []
        return heard

    def announce(self, ready: bool) -> None:
        """Publish on the ready topic."""
        self._ready.publish(ready)

    def _hear(self, message: Any) -> None:
        with self._lock:
            self._heard.append(message.data)
