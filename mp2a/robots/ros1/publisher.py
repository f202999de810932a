"""The watchdog's end of ROS 1: a topic of Twists, and a mux that may have to be asked first."""

import contextlib
import threading
import time
from typing import Any

from mp2a.exceptions import DependencyError
from mp2a.robots.publishers import Settings
from mp2a.robots.ros1.node import connect

_ASK_EVERY = 0.5
"""s between two requests for the command topic: the mux takes it away 2 s after the last message."""
_CONNECT = 5.0
"""s for the robot to connect to the topic."""


class Ros1Publisher:
    """Publishes Twist or TwistStamped with linear.x and angular.z only.

    Raises
    ------
    DependencyError
        If there is no ROS, no master, nobody listens to the command topic, or the mux cannot be asked.
    """

    def __init__(self, settings: Settings) -> None:
        rospy = self._rospy = connect(f"watchdog_{settings['role']}")
        from geometry_msgs.msg import Twist, TwistStamped

        self._stamped = settings["message"] == "TwistStamped"
        self._frame = settings["body_frame"]
        self._twist, self._twist_stamped = Twist, TwistStamped
        kind = TwistStamped if self._stamped else Twist
        self._topic = settings["command_topic"]
        self._publisher = rospy.Publisher(self._topic, kind, queue_size=1, tcp_nodelay=True)
        self._human_pause, self._human_at = settings["human_pause"], float("-inf")
        if settings["human_topic"]:
            rospy.Subscriber(settings["human_topic"], kind, self._hear_human, queue_size=1)
        deadline = time.monotonic() + _CONNECT
        while self._publisher.get_num_connections() == 0:
            if time.monotonic() > deadline:
                raise DependencyError(f"ROS 1: nobody listens to {self._topic}; is the robot on?")
            time.sleep(0.02)
        self._over = threading.Event()
        self._mux = self._ask_mux(settings["acquire"], settings["release"]) if settings["acquire"] else None

    def send(self, speed: float, turn_rate: float) -> None:
        """Publish a command."""
        twist = self._twist()
        twist.linear.x, twist.angular.z = speed, turn_rate
        if not self._stamped:
            self._publisher.publish(twist)
            return
        message = self._twist_stamped(twist=twist)
        message.header.stamp, message.header.frame_id = self._rospy.Time.now(), self._frame
        self._publisher.publish(message)

    def human(self) -> bool:
        """Whether there was a command on the human's topic of late."""
        return time.monotonic() - self._human_at < self._human_pause

    def close(self) -> None:
        """Release the mux and leave ROS."""
        self._over.set()
        if self._mux is not None:
            thread, release = self._mux
            thread.join(2 * _ASK_EVERY)
            release(self._topic)
        self._rospy.signal_shutdown("the robot stands")

    def _hear_human(self, _message: Any) -> None:
        self._human_at = time.monotonic()

    def _ask_mux(self, acquire: str, release: str) -> Any:
        """Ask for the topic in a thread of its own, again and again: a human of higher priority may have it."""
        try:
            from nifti_teleop.srv import Acquire, Release
        except ImportError as error:
            message = (
                f"ROS 1: {error}, which the mux at {acquire} needs; install the robot's nifti_teleop, or let the robot "
                "ask: command_topic = '/private/nav/cmd_vel', acquire = '', release = ''"
            )
            raise DependencyError(message) from error
        rospy = self._rospy
        for name in (acquire, release):
            try:
                rospy.wait_for_service(name, _CONNECT)
            except rospy.ROSException as error:
                raise DependencyError(f"ROS 1: {error}; is the robot's mux on?") from error
        ask, let_go = rospy.ServiceProxy(acquire, Acquire), rospy.ServiceProxy(release, Release)

        def quietly(service: Any, topic: str) -> None:
            with contextlib.suppress(rospy.ServiceException):  # a mux that is down lets nothing through either
                service(topic)

        def keep_asking() -> None:
            while not self._over.is_set():
                quietly(ask, self._topic)
                self._over.wait(_ASK_EVERY)

        thread = threading.Thread(target=keep_asking, daemon=True)
        thread.start()
        return thread, lambda topic: quietly(let_go, topic)
