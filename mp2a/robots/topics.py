"""A robot's topics and types of their messages: for bags, and for robots over ROS; without numpy, for the watchdog."""

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mp2a.robots.robot_config import RobotConfig

SYNC_TOPIC = "/sync"
"""Where robots find each other and agree when to start (thesis, chapter 3)."""
EVENTS_TOPIC = "/mp2a/events"
"""Texts about what a robot comes into and leaves, in bags."""
COMMAND_TYPES = {"Twist": "geometry_msgs/msg/Twist", "TwistStamped": "geometry_msgs/msg/TwistStamped"}
BOOL, CLOUD, STRING = "std_msgs/msg/Bool", "sensor_msgs/msg/PointCloud2", "std_msgs/msg/String"
TRANSFORMS = "tf2_msgs/msg/TFMessage"


class Topic(NamedTuple):
    """A topic of a robot."""

    field: str
    """Of `RobotConfig` that names it; ``tf``, ``tf_static`` and ``events`` are no field of their own."""
    name: str
    types: tuple[str, ...]
    """That it may have; the first one is written."""
    wanted: bool
    """Whether a robot cannot be replayed without it."""


def sensor_topics(config: "RobotConfig") -> tuple[Topic, ...]:
    """Return what tells where a robot is and what it sees; one without LIDAR has no topic of points."""
    stamped, by_tf = config.pose == "stamped", config.pose == "tf"
    old = (TRANSFORMS, "tf/msg/tfMessage")
    topics = [
        Topic("odometry_topic", config.odometry_topic, ("nav_msgs/msg/Odometry",), not stamped),
        Topic("tf", config.tf_topic, old, by_tf),
        Topic("tf_static", f"{config.tf_topic}_static", old, False),
    ]
    if stamped:
        topics.append(Topic("pose_topic", config.pose_topic, ("geometry_msgs/msg/PoseStamped",), True))
        topics.append(Topic("twist_topic", config.twist_topic, ("geometry_msgs/msg/TwistStamped",), True))
    if config.points_topic:
        topics.append(Topic("points_topic", config.points_topic, (CLOUD,), True))
    if config.human_topic:
        topics.append(Topic("human_topic", config.human_topic, _commands(config), False))
    return tuple(topic._replace(name=f"/{topic.name.lstrip('/')}") for topic in topics)


def bag_topics(config: "RobotConfig") -> tuple[Topic, ...]:
    """Return all that a robot's bag holds."""
    command = f"/{config.command_topic.lstrip('/')}"
    return (
        Topic("command_topic", command, _commands(config), False),
        Topic("events", EVENTS_TOPIC, (STRING,), False),
        *sensor_topics(config),
    )


def _commands(config: "RobotConfig") -> tuple[str, ...]:
    """Return both types of commands, the robot's own first."""
    own = COMMAND_TYPES[config.message]
    return (own, *(kind for kind in COMMAND_TYPES.values() if kind != own))
