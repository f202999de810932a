"""Where commands go from the watchdog: a topic of ROS 1 or ROS 2, or a file.

Plain floats and no numpy: the watchdog is to start fast and do one thing.
"""

import importlib
import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

Settings = Mapping[str, Any]
"""Fields of `mp2a.robots.robot_config.RobotConfig` by name, and where to publish."""


class CommandPublisher(Protocol):
    """Sends commands to one robot."""

    def send(self, speed: float, turn_rate: float) -> None:
        """Publish a command, m/s and rad/s."""

    def human(self) -> bool:
        """Return whether a human drives the robot at present."""

    def close(self) -> None:
        """Let go of the robot."""


class FilePublisher:
    """Appends each command to a file, a line ``[monotonic time, speed, turn rate]``; a robot for tests of the watchdog.

    A human drives it as long as a file of the same name with ``.human`` added exists.
    """

    def __init__(self, settings: Settings) -> None:
        self._path = Path(settings["file"])
        self._human = self._path.with_name(self._path.name + ".human")
        self._file = self._path.open("a", buffering=1)

    def send(self, speed: float, turn_rate: float) -> None:
        """Append a line."""
        self._file.write(json.dumps([time.monotonic(), speed, turn_rate]) + "\n")

    def human(self) -> bool:
        """Look for the other file."""
        return self._human.exists()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


PUBLISHERS = {
    "file": "mp2a.robots.publishers:FilePublisher",
    "ros1": "mp2a.robots.ros_commands:RosCommands",
    "ros2": "mp2a.robots.ros_commands:RosCommands",
}
"""By name: module and class, imported by the watchdog alone. A new wire is one more line."""


def open_publisher(settings: Settings) -> CommandPublisher:
    """Build the publisher that the settings name."""
    module, _, name = PUBLISHERS[settings["publisher"]].partition(":")
    make: Callable[[Settings], CommandPublisher] = getattr(importlib.import_module(module), name)
    return make(settings)
