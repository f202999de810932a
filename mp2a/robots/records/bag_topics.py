"""What a bag of one robot holds: topics and types of messages, for who writes bags and who reads them."""

from typing import NamedTuple

from mp2a.robots.table import RobotInterface

EVENTS_TOPIC = "/mp2a/events"
"""Texts about what a robot comes into and leaves."""
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_COMMANDS = {"Twist": "geometry_msgs/msg/Twist", "TwistStamped": "geometry_msgs/msg/TwistStamped"}


class Topic(NamedTuple):
    """A topic of a bag."""

    field: str
    """Of `RobotInterface` that names it; ``tf``, ``tf_static`` and ``events`` have one name for all robots."""
    name: str
    types: tuple[str, ...]
    """That it may have; the first one is written."""
    wanted: bool
    """Whether a robot cannot be replayed without it."""


def topics(interface: RobotInterface) -> tuple[Topic, ...]:
    """Topics of one robot's bag; a robot without LIDAR has none for points."""
    stamped, by_tf = interface.pose == "stamped", interface.pose == "tf"
    command = _COMMANDS[interface.message]
    either = (command, *(kind for kind in _COMMANDS.values() if kind != command))
    found = [
        Topic("command_topic", interface.command_topic, either, False),
        Topic("odometry_topic", interface.odometry_topic, ("nav_msgs/msg/Odometry",), not stamped),
        Topic("tf", "/tf", _TRANSFORMS, by_tf),
        Topic("tf_static", "/tf_static", _TRANSFORMS, False),
        Topic("events", EVENTS_TOPIC, ("std_msgs/msg/String",), False),
    ]
    if stamped:
        found.append(Topic("pose_topic", interface.pose_topic, ("geometry_msgs/msg/PoseStamped",), True))
        found.append(Topic("twist_topic", interface.twist_topic, ("geometry_msgs/msg/TwistStamped",), True))
    if interface.points_topic:
        found.append(Topic("points_topic", interface.points_topic, ("sensor_msgs/msg/PointCloud2",), True))
    if interface.human_topic:
        found.append(Topic("human_topic", interface.human_topic, either, False))
    return tuple(topic._replace(name=f"/{topic.name.lstrip('/')}") for topic in found)
