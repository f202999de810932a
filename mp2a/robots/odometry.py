"""What messages of ROS 1 and ROS 2 have in common: the last one of a topic, and rotations."""

import math
import threading
import time
from typing import Generic, Protocol, TypeVar

import numpy as np

from mp2a.spatial import Array, quaternion_matrix

Message = TypeVar("Message")


class Quaternion(Protocol):
    """A ``geometry_msgs/Quaternion``."""

    x: float
    y: float
    z: float
    w: float


def heading(q: Quaternion) -> float:
    """Angle about the vertical, rad, of a body whose rotation is ``q``."""
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def rotation(q: Quaternion) -> Array:
    """Matrix ``(3, 3)`` of a unit quaternion: takes vectors from the turned frame."""
    return np.reshape(quaternion_matrix(q.x, q.y, q.z, q.w), (3, 3))


class LastSeen(Generic[Message]):
    """The last message of a topic and when it came; written by one thread, read by another."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._message: Message | None = None
        self._new = False
        self._came = -math.inf

    def put(self, message: Message) -> None:
        """Take in a message."""
        with self._lock:
            self._message, self._new, self._came = message, True, time.monotonic()

    def within(self, age: float) -> Message | None:
        """Return the last message if it came at most ``age`` s ago."""
        with self._lock:
            return self._message if time.monotonic() - self._came <= age else None

    def take(self) -> Message | None:
        """Return the last message if it has come since the last call."""
        with self._lock:
            new, self._new = self._new, False
            return self._message if new else None
