"""What a node of ROS 1 and one of ROS 2 have in common; all else that is ROS here is written once, over it.

Without numpy, for the watchdog needs none.
"""

import importlib
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

BACKENDS = {"ros1": "mp2a.robots.ros1.node:Ros1Node", "ros2": "mp2a.robots.ros2.node:Ros2Node"}
"""By name: module and class. Another middleware is a file and a line here."""

Take = Callable[[], list[tuple[float, Any]]]
"""Returns the messages that have come since the last call, oldest first, each after the reading of `time.monotonic` at
which it came (ROS 2: at which it was taken); never waits."""


class TopicWriter(NamedTuple):
    """One's end of a topic."""

    write: Callable[..., None]
    """Publishes a message; takes its fields in their order."""
    listeners: Callable[[], int]
    """Counts who listens."""


class RosBackend(Protocol):
    """A node. Types of messages are called as in ROS 2: ``std_msgs/msg/Bool``."""

    name: str
    """ROS 1 or ROS 2, for errors."""

    def message(self, kind: str) -> Any:
        """Return the class of a type of messages, which is built of its fields in their order."""

    def header(self, frame: str) -> Any:
        """Return a ``std_msgs/Header`` of now."""

    def clock(self) -> float:
        """Return the time that stamps go by, s."""

    def writer(self, topic: str, kind: str, *, depth: int = 10, kept: bool = False) -> TopicWriter:
        """Open a topic for writing; what is kept reaches those who come later, too."""

    def reader(
        self, topic: str, kind: str, *, depth: int = 1, kept: bool = False, reliable: bool = False, own: bool = True
    ) -> Take:
        """Open a topic for reading, the newest ``depth`` messages of it; without ``own`` not those of this node."""

    def acquire(self, topic: str, acquire: str, release: str) -> Callable[[], None]:
        """Ask the mux with these services for a topic, until the function that this returns is called."""

    def close(self) -> None:
        """Leave ROS."""


def open_backend(backend: str, role: str) -> RosBackend:
    """Become a node of one of the `BACKENDS`.

    Raises
    ------
    DependencyError
        If that ROS is not installed, or does not answer.
    """
    module, _, name = BACKENDS[backend].partition(":")
    node: RosBackend = getattr(importlib.import_module(module), name)(role)
    return node
