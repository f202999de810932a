"""The watchdog's end of ROS 2: a topic of Twists, written to DDS."""

import time

from mp2a.exceptions import DependencyError
from mp2a.robots.publishers import Settings
from mp2a.robots.ros2.node import Node, take

_CONNECT = 10.0
"""s for the robot to be found."""


class Ros2Publisher:
    """Publishes Twist or TwistStamped with linear.x and angular.z only.

    Raises
    ------
    DependencyError
        If there is no cyclonedds, nobody listens to the command topic, or the robot has a mux of ROS 1.
    """

    def __init__(self, settings: Settings) -> None:
        if settings["acquire"]:
            raise DependencyError("ROS 2: acquire: got a service, expected none; muxes that must be asked are ROS 1's")
        node = self._node = Node()
        from mp2a.robots.ros2.messages import Header, Time, Twist, TwistStamped, Vector3

        self._kinds = Header, Time, Twist, TwistStamped, Vector3
        self._stamped, self._frame = settings["message"] == "TwistStamped", settings["body_frame"]
        kind = TwistStamped if self._stamped else Twist
        topic = settings["command_topic"]
        self._writer = node.writer(topic, kind)
        self._by_hand = node.reader(settings["human_topic"], kind) if settings["human_topic"] else None
        self._human_pause, self._human_at = settings["human_pause"], float("-inf")
        deadline = time.monotonic() + _CONNECT
        while not self._writer.get_matched_subscriptions():
            if time.monotonic() > deadline:
                raise DependencyError(f"ROS 2: nobody listens to {topic}; is the robot on, and ROS_DOMAIN_ID the same?")
            time.sleep(0.02)

    def send(self, speed: float, turn_rate: float) -> None:
        """Publish a command."""
        header, stamp, twist_kind, stamped_kind, vector = self._kinds
        twist = twist_kind(vector(speed, 0.0, 0.0), vector(0.0, 0.0, turn_rate))
        if not self._stamped:
            self._writer.write(twist)
            return
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        self._writer.write(stamped_kind(header(stamp(seconds, nanoseconds), self._frame), twist))

    def human(self) -> bool:
        """Whether there was a command on the human's topic of late."""
        if self._by_hand is not None and take(self._by_hand):
            self._human_at = time.monotonic()
        return time.monotonic() - self._human_at < self._human_pause

    def close(self) -> None:
        """Nothing is held: DDS lets go when the process ends."""
