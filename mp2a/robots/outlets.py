"""What goes out to a robot over ROS 1 or ROS 2: commands, sounds, and what its LIDAR's points amount to."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mp2a.formation.constants import WINDOW
from mp2a.formation.safety import stop_signals
from mp2a.robots import cloud
from mp2a.robots.sender import Sender
from mp2a.robots.sound import sound_numbers
from mp2a.robots.table import RobotInterface
from mp2a.spatial import Array

Write = Callable[..., None]
"""Publishes one message on a topic; takes the message's fields in their order."""


class Wire(NamedTuple):
    """How one of the two ROS publishes."""

    writer: Callable[[str, Any], Write]
    """Of a topic by name and type of message."""
    header: Callable[[str], Any]
    """Makes a ``std_msgs/Header`` of now for a frame."""
    flag: Any
    """``std_msgs/Bool``."""
    sound: Any
    """``sound_play/SoundRequest``."""
    cloud: Any
    """``sensor_msgs/PointCloud2``."""
    field: Any
    """``sensor_msgs/PointField``."""


class Outlets(NamedTuple):
    """What a robot over ROS is told by; three are those of `mp2a.robots.interface.Robot`."""

    send: Callable[[Array], None]
    """Hands a command to the watchdog, if armed."""
    warn: Callable[[str | None], None]
    """Says a text, or beeps, through sound_play."""
    close: Callable[[], None]
    """Stops the robot through the watchdog; takes its stop signals back."""
    show: Callable[[Array], None]
    """Publishes what points ``(k, 2)`` in the body's frame amount to, as the thesis' obstacle_detection does."""


def outlets(interface: RobotInterface, wire: Wire, sender: Sender | None) -> Outlets:
    """Open a robot's topics.

    Parameters
    ----------
    interface
        Its topics; nothing is published on those without a name.
    wire
        How to publish.
    sender
        To the watchdog; None: not armed.
    """

    def writer(topic: str, kind: Any) -> Write:
        return wire.writer(topic, kind) if topic else _nowhere

    say = writer(interface.sound_topic, wire.sound)
    stop_front = writer(interface.stop_front_topic, wire.flag)
    stop_rear = writer(interface.stop_rear_topic, wire.flag)
    show_points = writer(interface.obstacles_topic, wire.cloud)
    length, width = np.array([interface.model.length]), np.array([interface.model.width])

    def send(command: Array) -> None:
        if sender is not None:
            sender.send(float(command[0]), float(command[1]))

    def warn(text: str | None) -> None:
        say(*sound_numbers(text), 1.0, text or "", "")

    def show(points: Array) -> None:
        signals = stop_signals(points, np.zeros(len(points), dtype=np.intp), length, width)
        stop_front(bool(signals.front[0]))
        stop_rear(bool(signals.rear[0]))
        near = points[(np.abs(points) < WINDOW / 2).all(axis=1)]
        show_points(*cloud.content(near, wire.header(interface.body_frame), wire.field))

    def close() -> None:
        try:  # before the watchdog's last half second, in which they get out
            stop_front(False)
            stop_rear(False)
        finally:
            if sender is not None:
                sender.close()

    return Outlets(send, warn, close, show)


def _nowhere(*_fields: Any) -> None:
    """Publish nothing."""
