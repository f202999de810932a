"""The watchdog's end of ROS: a topic of Twists, and a mux that may have to be asked first."""

import time

from mp2a.exceptions import DependencyError
from mp2a.robots.ros_backend import open_backend
from mp2a.robots.topics import COMMAND_TYPES
from mp2a.robots.watchdog import Settings

_CONNECT = 10.0
"""s for the robot to listen to the topic."""


class RosCommands:
    """Publishes Twist or TwistStamped with linear.x and angular.z only.

    Raises
    ------
    DependencyError
        If there is no ROS, nobody listens to the command topic, or its mux cannot be asked.
    """

    def __init__(self, settings: Settings) -> None:
        node = self._node = open_backend(settings["backend"], f"watchdog_{settings['role']}")
        kind = COMMAND_TYPES[settings["message"]]
        self._twist, self._vector = (node.message(f"geometry_msgs/msg/{name}") for name in ("Twist", "Vector3"))
        self._frame = settings["body_frame"] if settings["message"] == "TwistStamped" else None
        topic = settings["command_topic"]
        self._write, listeners = node.writer(topic, kind, depth=1)
        self._by_hand = node.reader(settings["human_topic"], kind) if settings["human_topic"] else list
        self._human_pause, self._human_at = settings["human_pause"], float("-inf")
        deadline = time.monotonic() + _CONNECT
        while not listeners():
            if time.monotonic() > deadline:
                raise DependencyError(
                    f"{node.name}: nobody listens to {topic}; is the robot on, and in the same ROS network?"
                )
            time.sleep(0.02)
        acquire, release = settings["acquire"], settings["release"]
        self._release = node.acquire(topic, acquire, release) if acquire else None

    def send(self, speed: float, turn_rate: float) -> None:
        """Publish a command."""
        linear, angular = self._vector(speed, 0.0, 0.0), self._vector(0.0, 0.0, turn_rate)
        if self._frame is None:
            self._write(linear, angular)
        else:
            self._write(self._node.header(self._frame), self._twist(linear, angular))

    def human(self) -> bool:
        """Return whether there was a command on the human's topic of late."""
        for came, _ in self._by_hand():
            self._human_at = came
        return time.monotonic() - self._human_at < self._human_pause

    def close(self) -> None:
        """Release the mux and leave ROS."""
        if self._release is not None:
            self._release()
        self._node.close()
