"""A robot over ROS 1 or ROS 2: topics in; commands through the watchdog, sounds and stop signals out."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from mp2a.formation.constants import WINDOW
from mp2a.formation.safety import stop_signals
from mp2a.robots import cloud
from mp2a.robots.adapters import AdapterConfig, AdapterResult
from mp2a.robots.interface import Sensed
from mp2a.robots.robot_config import RobotConfig
from mp2a.robots.ros_backend import RosBackend, open_backend
from mp2a.robots.sender import Sender
from mp2a.robots.sound import sound_numbers
from mp2a.robots.topic_state import TopicState
from mp2a.robots.topics import BOOL, CLOUD, STRING, SYNC_TOPIC, sensor_topics
from mp2a.robots.transforms import Transforms
from mp2a.spatial import Array

_TRANSFORMS = 100
"""Messages of a topic of transforms that are kept from one look to the next: several programs publish on it."""
_TEXTS = 1000
_STOPS = ("stop_front_topic", "stop_rear_topic")


def make(config: AdapterConfig) -> AdapterResult:
    """Reach the robot of this process."""
    [role] = config.roles
    robot_config = config.file.configs[role]
    node = open_backend(config.file.adapter, role)
    sender = Sender(robot_config, config.file.adapter, role=role) if config.armed else None
    robot = RosRobot(node, robot_config, sender)
    return AdapterResult([robot], channel=lambda: RosChannel(node, robot_config.ready_topic))


class RosRobot:
    """One robot over ROS.

    Parameters
    ----------
    node
        Of this process.
    config
        Topics, frames, rates; nothing is published, and nothing heard, on topics without a name.
    sender
        To the watchdog; None: not armed, commands are only shown by who watches.
    """

    def __init__(self, node: RosBackend, config: RobotConfig, sender: Sender | None) -> None:
        self.has_lidar = bool(config.points_topic)
        self._node, self._config, self._sender = node, config, sender
        self._state = TopicState(config, Transforms(node.clock), time.monotonic)
        self._readers = [
            (topic.field, node.reader(
                topic.name, topic.types[0], depth=_TRANSFORMS if topic.field.startswith("tf") else 1,
                kept=topic.field == "tf_static", reliable=topic.field == "tf_static",
            )) for topic in sensor_topics(config)
        ]  # fmt: skip
        self._readers += [
            (field, node.reader(name, BOOL, own=False)) for field in _STOPS if (name := getattr(config, field))
        ]
        self._say = self._writer(config.sound_topic, "sound_play/msg/SoundRequest")
        self._stops = [self._writer(getattr(config, field), BOOL) for field in _STOPS]
        self._obstacles = self._writer(config.obstacles_topic, CLOUD)
        self._field = node.message("sensor_msgs/msg/PointField")
        self._size = np.array([config.model.length]), np.array([config.model.width])

    def sense(self) -> Sensed:
        """Return what has come last, and publish what its points amount to."""
        for field, take in self._readers:
            for came, message in take():
                self._state.put(field, came, message)
        sensed = self._state.sensed()
        if sensed.points is not None:
            self.show(sensed.points)
        return sensed

    def send(self, command: Array) -> None:
        """Hand a command to the watchdog, if armed."""
        if self._sender is not None:
            self._sender.send(float(command[0]), float(command[1]))

    def warn(self, text: str | None) -> None:
        """Say a text, or (None) beep, through sound_play."""
        self._say(*sound_numbers(text), 1.0, text or "", "")

    def show(self, points: Array) -> None:
        """Publish what points ``(k, 2)`` in the body's frame amount to, as the thesis' obstacle_detection does."""
        signals = stop_signals(points, np.zeros(len(points), dtype=np.intp), *self._size)
        for stop, holds in zip(self._stops, (signals.front, signals.rear), strict=True):
            stop(bool(holds[0]))
        near = points[(np.abs(points) < WINDOW / 2).all(axis=1)]
        header = self._node.header(self._config.body_frame)
        self._obstacles(*cloud.cloud_fields(np.column_stack((near, np.zeros(len(near)))), header, self._field))

    def close(self) -> None:
        """Stop the robot through the watchdog; take its stop signals back."""
        try:  # before the watchdog's last half second, in which they get out
            for stop in self._stops:
                stop(False)
        finally:
            if self._sender is not None:
                self._sender.close()

    def _writer(self, topic: str, kind: str) -> Callable[..., None]:
        return self._node.writer(topic, kind).write if topic else _nowhere


class RosChannel:
    """Texts between robots on the topic ``/sync``; ``/all_ready`` for this robot's own programs.

    Parameters
    ----------
    node
        Of this process.
    ready_topic
        Where to tell the robot's programs that all are ready.
    """

    def __init__(self, node: RosBackend, ready_topic: str) -> None:
        self.publish = node.writer(SYNC_TOPIC, STRING, depth=100).write
        self.announce = node.writer(ready_topic, BOOL, kept=True).write
        self._take = node.reader(SYNC_TOPIC, STRING, depth=_TEXTS, reliable=True)

    def receive(self) -> list[str]:
        """Return the texts that have come, one's own among them."""
        return [message.data for _, message in self._take()]


def _nowhere(*_fields: Any) -> None:
    """Publish nothing."""
