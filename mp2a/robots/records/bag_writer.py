"""One robot's steps as a bag of ROS 1 or ROS 2, written by the rosbags package."""

from pathlib import Path
from typing import Any

import numpy as np

from mp2a.dependencies import need
from mp2a.formation.constants import HIGHEST, LOWEST
from mp2a.robots import cloud
from mp2a.robots.robot_config import RobotConfig
from mp2a.robots.ticks import BEGINS, DriveTick, changes
from mp2a.robots.topics import bag_topics
from mp2a.spatial import Array

BAGS = ("mcap", "ros2", "ros1")
"""Rosbag2 with MCAP files, rosbag2 with SQLite files, rosbag."""
_NOT_WRITTEN = ("tf_static", "human_topic")
_NANOSECONDS = 1_000_000_000
_UNKNOWN = np.zeros(36)
"""A covariance."""


def bag_path(folder: Path, role: str, bag: str) -> Path:
    """Return where the bag of a robot is: a folder, or a file ``.bag`` of ROS 1."""
    return folder / (f"{role}.bag" if bag == "ros1" else role)


class BagWriter:
    """Writes one robot's bag.

    Parameters
    ----------
    path
        From `bag_path`; must not exist.
    bag
        One of `BAGS`.
    role
        What events call the robot.
    config
        Its topics and frames.

    Raises
    ------
    DependencyError
        If rosbags is not installed.
    """

    def __init__(self, path: Path, bag: str, role: str, config: RobotConfig) -> None:
        rosbag1, rosbag2, typesys = (
            need(f"rosbags.{name}", extra="record", purpose="a bag") for name in ("rosbag1", "rosbag2", "typesys")
        )
        self._role, self._config, self._ros1 = role, config, bag == "ros1"
        self._store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if self._ros1 else typesys.Stores.ROS2_HUMBLE)
        self._writer: Any
        if self._ros1:
            transforms = "geometry_msgs/TransformStamped[] transforms"
            self._store.register(typesys.get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))
            self._writer = rosbag1.Writer(path)
            self._serialize: Any = self._store.serialize_ros1
        else:
            plugin = rosbag2.StoragePlugin.MCAP if bag == "mcap" else rosbag2.StoragePlugin.SQLITE3
            # Version 9 of the metadata is not read by ROS 2 Humble and Iron.
            self._writer = rosbag2.Writer(path, version=8, storage_plugin=plugin)
            if bag == "mcap":
                self._writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
            self._serialize = self._store.serialize_cdr
        self._writer.open()
        self._topics = {
            topic.field: (self._writer.add_connection(topic.name, topic.types[0], typestore=self._store), topic)
            for topic in bag_topics(config) if topic.field not in _NOT_WRITTEN
        }  # fmt: skip
        self._flags: tuple[bool, ...] = BEGINS

    def tell(self, stamp: int, text: str) -> None:
        """Write an event at ``stamp`` ns."""
        self._put("events", stamp, self._new("std_msgs/String", f"{self._role} {text}"))

    def add(self, stamp: int, tick: DriveTick) -> None:
        """Write a tick at ``stamp`` ns.

        A pose or speed that was lost is not a number in the odometry; ``/tf`` then is silent.
        """
        sensed, config = tick.sensed, self._config
        in_fixed, in_body = (self._header(stamp, frame) for frame in (config.fixed_frame, config.body_frame))
        pose, twist, command = self._pose(sensed.pose), self._twist(sensed.twist), self._twist(tick.command)
        if np.isfinite(sensed.pose).all():
            translation = self._new("geometry_msgs/Vector3", *_floats(*sensed.pose[:2], 0))
            moved = self._new("geometry_msgs/Transform", translation, pose.orientation)
            transform = self._new("geometry_msgs/TransformStamped", in_fixed, config.body_frame, moved)
            self._put("tf", stamp, self._new("tf2_msgs/TFMessage", [transform]))
        uncertain = (
            self._new(f"geometry_msgs/{kind}WithCovariance", value, _UNKNOWN)
            for kind, value in (("Pose", pose), ("Twist", twist))
        )
        self._put("odometry_topic", stamp, self._new("nav_msgs/Odometry", in_fixed, config.body_frame, *uncertain))
        if config.pose == "stamped":
            self._put("pose_topic", stamp, self._new("geometry_msgs/PoseStamped", in_fixed, pose))
            self._put("twist_topic", stamp, self._new("geometry_msgs/TwistStamped", in_body, twist))
        if sensed.points is not None and config.points_topic:
            self._put("points_topic", stamp, self._cloud(in_body, sensed.points))
        stamped = config.message == "TwistStamped"
        message = self._new("geometry_msgs/TwistStamped", in_body, command) if stamped else command
        self._put("command_topic", stamp, message)
        for text in changes(self._flags, tick.flags):
            self.tell(stamp, text)
        self._flags = tick.flags

    def close(self) -> None:
        """Write the index; before it a bag is not whole."""
        self._writer.close()

    def _put(self, field: str, stamp: int, message: Any) -> None:
        connection, topic = self._topics[field]
        self._writer.write(connection, stamp, self._serialize(message, topic.types[0]))

    def _new(self, kind: str, *fields: Any) -> Any:
        package, _, name = kind.partition("/")
        return self._store.types[f"{package}/msg/{name}"](*fields)

    def _header(self, stamp: int, frame: str) -> Any:
        time = self._new("builtin_interfaces/Time", *divmod(stamp, _NANOSECONDS))
        return self._new("std_msgs/Header", *([0] * self._ros1), time, frame)  # ROS 1 counts headers

    def _pose(self, pose: Array) -> Any:
        x, y, heading = pose
        turned = self._new("geometry_msgs/Quaternion", *_floats(0, 0, np.sin(heading / 2), np.cos(heading / 2)))
        return self._new("geometry_msgs/Pose", self._new("geometry_msgs/Point", *_floats(x, y, 0)), turned)

    def _twist(self, speeds: Array) -> Any:
        linear, angular = ((speeds[0], 0, 0), (0, 0, speeds[1]))
        vectors = (self._new("geometry_msgs/Vector3", *_floats(*vector)) for vector in (linear, angular))
        return self._new("geometry_msgs/Twist", *vectors)

    def _cloud(self, header: Any, points: Array) -> Any:
        """Return points in the body's frame; their height, which nobody knows any more, is one that is in the way."""
        placed = np.column_stack((points, np.full(len(points), (LOWEST + HIGHEST) / 2)))
        fields = list(cloud.cloud_fields(placed, header, lambda *field: self._new("sensor_msgs/PointField", *field)))
        fields[7] = np.frombuffer(fields[7], dtype=np.uint8)
        return self._new("sensor_msgs/PointCloud2", *fields)


def _floats(*numbers: float) -> tuple[float, ...]:
    return tuple(map(float, numbers))
