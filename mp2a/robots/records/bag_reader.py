"""Bags of ROS 1 and ROS 2, read message by message with the rosbags package."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mp2a.dependencies import need
from mp2a.exceptions import InputError
from mp2a.file_kinds import kind_of_file
from mp2a.robots.topics import Topic


class BagMessage(NamedTuple):
    """A message as it is in the bag."""

    stamp: int
    """ns, when it was recorded."""
    field: str
    """Of its `Topic`."""
    kind: str
    raw: bytes


def bag_of(path: Path, role: str) -> Path:
    """Return the bag of a robot: the path itself if it is a bag, else what has the robot's name in that folder.

    Raises
    ------
    InputError
        If there is none.
    """
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return path
    names = (role, f"{role}.bag", f"{role}.mcap", f"{role}.db3")
    bag = next((path / name for name in names if (path / name).exists()), None)
    if bag is None:
        content = ", ".join(sorted(one.name for one in path.iterdir())) or "nothing"
        raise InputError(f"recording: got {path} with {content} in it, expected one of {', '.join(names)}")
    return bag


class BagReader:
    """Reads topics of a bag in the order of time.

    Parameters
    ----------
    path
        A file ``.bag``, ``.mcap`` or ``.db3``, or a folder of rosbag2.
    topics
        To be read. Those that are wanted must be there; a bag may have a topic without a message.
    role
        What errors call the robot.

    Attributes
    ----------
    counts
        Numbers of messages by the topics' fields.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or a topic is missing or of another type.
    DependencyError
        If rosbags is not installed.
    """

    def __init__(self, path: Path, topics: Sequence[Topic], role: str) -> None:
        AnyReader = need("rosbags.highlevel", extra="record", purpose="a recording").AnyReader
        typesys = need("rosbags.typesys", extra="record", purpose="a recording")
        self.path = path
        try:
            # Bags of ROS 2 Humble and older in SQLite files do not hold the definitions of their messages.
            self._reader = AnyReader([path], default_typestore=typesys.get_typestore(typesys.Stores.ROS2_HUMBLE))
            self._reader.open()
        except Exception as error:  # there is no end to what a broken file raises
            raise InputError(
                f"recording: {path} cannot be read as a bag of ROS 1 or ROS 2: it is {kind_of_file(path)} ({error})"
            ) from error
        self._fields = {topic.name: topic.field for topic in topics}
        there: dict[str, list[Any]] = {}  # of ROS 1 one a publisher
        for connection in self._reader.connections:
            there.setdefault(_absolute(connection.topic), []).append(connection)
        try:
            for topic in topics:
                _check(path, topic, role, there)
        except InputError:
            self.close()
            raise
        self._connections = [one for name in self._fields for one in there.get(name, [])]
        self.counts = {field: sum(one.msgcount for one in there.get(name, [])) for name, field in self._fields.items()}

    def messages(self) -> Iterator[BagMessage]:
        """Yield the messages of the topics, by time; raises `InputError` where the file is broken."""
        try:
            for connection, stamp, raw in self._reader.messages(self._connections):
                yield BagMessage(stamp, self._fields[_absolute(connection.topic)], connection.msgtype, raw)
        except Exception as error:
            raise InputError(f"recording: {self.path} breaks off ({error})") from error

    def decode(self, message: BagMessage) -> Any:
        """Return the message as an object with the fields of its type."""
        try:
            return self._reader.deserialize(message.raw, message.kind)
        except Exception as error:
            raise InputError(f"recording: {self.path}: {message.kind} at {message.stamp} ns: {error}") from error

    def close(self) -> None:
        """Close the file."""
        if self._reader.stack is not None:
            self._reader.close()


def _check(path: Path, topic: Topic, role: str, there: Mapping[str, Sequence[Any]]) -> None:
    what = f"{topic.name}, {topic.field} of {role}"
    kinds = sorted({one.msgtype for one in there.get(topic.name, [])})
    if topic.wanted and not kinds:
        names = ", ".join(f"{name} ({same[0].msgtype})" for name, same in sorted(there.items())) or "none"
        raise InputError(f"recording: {path}: got no {what} ({topic.types[0]}), expected it among its topics: {names}")
    if not set(kinds) <= set(topic.types):
        raise InputError(f"recording: {path}: {what}: got {', '.join(kinds)}, expected {' or '.join(topic.types)}")


def _absolute(name: str) -> str:
    return f"/{name.lstrip('/')}"
