"""One robot's steps as a bag of ROS 1 or ROS 2, written by the rosbags package."""

from pathlib import Path
from typing import Any

import numpy as np

from mp2a.exceptions import DependencyError
from mp2a.formation.constants import HIGHEST, LOWEST
from mp2a.robots.records.bag_topics import topics
from mp2a.robots.steps import BEGINS, Step, events
from mp2a.robots.table import RobotInterface
from mp2a.spatial import Array

BAGS = ("mcap", "ros2", "ros1")
"""Rosbag2 with MCAP files, rosbag2 with SQLite files, rosbag."""
_NOT_WRITTEN = ("tf_static", "human_topic")
_NANOSECONDS = 1_000_000_000


def bag_path(folder: Path, role: str, bag: str) -> Path:
    """Where the bag of a robot is: a folder, or a file ``.bag`` of ROS 1."""
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
    interface
        Its topics and frames.

    Raises
    ------
    DependencyError
        If rosbags is not installed.
    """

    def __init__(self, path: Path, bag: str, role: str, interface: RobotInterface) -> None:
        try:
            from rosbags import rosbag1, rosbag2
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        except ImportError as error:
            raise DependencyError(f"a bag needs rosbags: pip install 'mp2a[record]' ({error})") from error
        self._role, self._interface, self._ros1 = role, interface, bag == "ros1"
        self._store = get_typestore(Stores.ROS1_NOETIC if self._ros1 else Stores.ROS2_HUMBLE)
        self._writer: Any
        if self._ros1:
            transforms = get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
            self._store.register(transforms)
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
        written = [topic for topic in topics(interface) if topic.field not in _NOT_WRITTEN]
        self._topics = {
            topic.field: (self._writer.add_connection(topic.name, topic.types[0], typestore=self._store), topic)
            for topic in written
        }
        self._flags: tuple[bool, ...] = BEGINS

    def tell(self, stamp: int, text: str) -> None:
        """Write an event at ``stamp`` ns."""
        self._put("events", stamp, self._new("std_msgs/msg/String", data=f"{self._role} {text}"))

    def add(self, stamp: int, step: Step) -> None:
        """Write a step at ``stamp`` ns.

        A pose or speed that was lost is not a number in the odometry; ``/tf`` then is silent.
        """
        pose, twist, points = step.sensed.pose, step.sensed.twist, step.sensed.points
        interface = self._interface
        if np.isfinite(pose).all():
            moved = self._transform(stamp, pose)
            self._put("tf", stamp, self._new("tf2_msgs/msg/TFMessage", transforms=[moved]))
        self._put("odometry_topic", stamp, self._odometry(stamp, pose, twist))
        if interface.pose == "stamped":
            header = self._header(stamp, interface.fixed_frame)
            placed = self._new("geometry_msgs/msg/PoseStamped", header=header, pose=self._pose(pose))
            self._put("pose_topic", stamp, placed)
            self._put("twist_topic", stamp, self._stamped(stamp, twist))
        if points is not None and interface.points_topic:
            self._put("points_topic", stamp, self._cloud(stamp, points))
        plain = interface.message == "Twist"
        command = self._twist(step.command) if plain else self._stamped(stamp, step.command)
        self._put("command_topic", stamp, command)
        for text in events(self._flags, step.flags):
            self.tell(stamp, text)
        self._flags = step.flags

    def close(self) -> None:
        """Write the index; before it a bag is not whole."""
        self._writer.close()

    def _put(self, field: str, stamp: int, message: Any) -> None:
        connection, topic = self._topics[field]
        self._writer.write(connection, stamp, self._serialize(message, topic.types[0]))

    def _new(self, kind: str, **values: Any) -> Any:
        return self._store.types[kind](**values)

    def _header(self, stamp: int, frame: str) -> Any:
        seconds, nanoseconds = divmod(stamp, _NANOSECONDS)
        time = self._new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        count = {"seq": 0} if self._ros1 else {}
        return self._new("std_msgs/msg/Header", stamp=time, frame_id=frame, **count)

    def _vector(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, kind: str = "Vector3") -> Any:
        return self._new(f"geometry_msgs/msg/{kind}", x=float(x), y=float(y), z=float(z))

    def _turned(self, heading: float) -> Any:
        z, w = float(np.sin(heading / 2)), float(np.cos(heading / 2))
        return self._new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w)

    def _pose(self, pose: Array) -> Any:
        place = self._vector(pose[0], pose[1], kind="Point")
        return self._new("geometry_msgs/msg/Pose", position=place, orientation=self._turned(pose[2]))

    def _twist(self, speeds: Array) -> Any:
        linear, angular = self._vector(x=speeds[0]), self._vector(z=speeds[1])
        return self._new("geometry_msgs/msg/Twist", linear=linear, angular=angular)

    def _stamped(self, stamp: int, speeds: Array) -> Any:
        header = self._header(stamp, self._interface.body_frame)
        return self._new("geometry_msgs/msg/TwistStamped", header=header, twist=self._twist(speeds))

    def _transform(self, stamp: int, pose: Array) -> Any:
        moved = self._new(
            "geometry_msgs/msg/Transform", translation=self._vector(pose[0], pose[1]), rotation=self._turned(pose[2])
        )
        return self._new(
            "geometry_msgs/msg/TransformStamped", header=self._header(stamp, self._interface.fixed_frame),
            child_frame_id=self._interface.body_frame, transform=moved,
        )  # fmt: skip

    def _odometry(self, stamp: int, pose: Array, twist: Array) -> Any:
        unknown = np.zeros(36)
        placed = self._new("geometry_msgs/msg/PoseWithCovariance", pose=self._pose(pose), covariance=unknown)
        moving = self._new("geometry_msgs/msg/TwistWithCovariance", twist=self._twist(twist), covariance=unknown)
        return self._new(
            "nav_msgs/msg/Odometry", header=self._header(stamp, self._interface.fixed_frame),
            child_frame_id=self._interface.body_frame, pose=placed, twist=moving,
        )  # fmt: skip

    def _cloud(self, stamp: int, points: Array) -> Any:
        """Points in the body's frame; their height, which nobody knows any more, is one that is in the way."""
        flat = np.full((len(points), 3), (LOWEST + HIGHEST) / 2, dtype="<f4")
        flat[:, :2] = points
        fields = [
            self._new("sensor_msgs/msg/PointField", name=name, offset=4 * k, datatype=7, count=1)  # FLOAT32
            for k, name in enumerate("xyz")
        ]
        return self._new(
            "sensor_msgs/msg/PointCloud2", header=self._header(stamp, self._interface.body_frame), height=1,
            width=len(flat), fields=fields, is_bigendian=False, point_step=12, row_step=12 * len(flat),
            data=flat.reshape(-1).view(np.uint8), is_dense=True,
        )  # fmt: skip
