"""What a robot's topics have told last: pose, twist, points and signals, whether over ROS or out of a bag."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from mp2a.formation.safety import from_cloud
from mp2a.robots import cloud
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.robot_config import RobotConfig
from mp2a.robots.transforms import Transforms, heading
from mp2a.spatial import Array

_MOUNT_AGE = 10.0
"""s for which a transform to a sensor is believed."""
_ROUNDING = 1e-6
"""s by which an age may be more than it may be: times are differences of large numbers."""


class TopicState:
    """The newest message of each of a robot's topics, and what they amount to.

    Parameters
    ----------
    config
        Says where pose and twist are from, and how old they may be.
    transforms
        Takes in what comes on ``tf`` and ``tf_static``.
    clock
        By which messages age, s.

    Attributes
    ----------
    unplaced : str
        Frame of points that were not used since nobody knows where it is; empty if there are none.
    """

    def __init__(self, config: RobotConfig, transforms: Transforms, clock: Callable[[], float]) -> None:
        self._config, self.transforms, self._clock = config, transforms, clock
        self._newest: dict[str, tuple[float, Any]] = {}
        self._stops = {"stop_front_topic": False, "stop_rear_topic": False}
        self.unplaced = ""

    def put(self, field: str, came: float, message: Any) -> None:
        """Take in a message of the topic of a field of `mp2a.robots.topics.Topic`, which came at ``came`` s."""
        if field in ("tf", "tf_static"):
            for transform in message.transforms:
                self.transforms.put(transform, fixed=field == "tf_static")
        elif field in self._stops:  # holds until the topic says otherwise
            self._stops[field] = bool(message.data)
        else:
            self._newest[field] = came, message

    def newest(self, field: str, age: float) -> Any:
        """Return the last message of a topic; None if it came more than ``age`` s ago."""
        came, message = self._newest.get(field, (-math.inf, None))
        return message if self._clock() - came <= age + _ROUNDING else None

    def sensed(self) -> Sensed:
        """Return what is known now; points only once for each cloud."""
        human = self.newest("human_topic", self._config.human_pause) is not None
        return Sensed(self.pose(), self.twist(), self._points(), human, *self._stops.values())

    def pose(self) -> Array:
        """Return the pose ``(3,)``, m, m, rad; not a number if it is too old, or missing."""
        config = self._config
        if config.pose == "stamped":
            stamped = self.newest("pose_topic", config.pose_age)
            return NO_POSE if stamped is None else _planar(stamped.pose)
        if config.pose == "odometry":
            odometry = self.newest("odometry_topic", config.pose_age)
            return NO_POSE if odometry is None else _planar(odometry.pose.pose)
        body = self.transforms.look_up(config.fixed_frame, config.body_frame)
        return NO_POSE if body is None or body.age > config.pose_age else body.pose

    def twist(self) -> Array:
        """Return the measured twist ``(2,)``, m/s and rad/s; not a number if it is too old, or missing."""
        topic = "twist_topic" if self._config.pose == "stamped" else "odometry_topic"
        message = self.newest(topic, self._config.pose_age)
        if message is None:
            return np.full(2, np.nan)
        return speeds(message.twist if topic == "twist_topic" else message.twist.twist)

    def _points(self) -> Array | None:
        """Return points in the body's frame that are in the way; None if none came, or nobody knows where from."""
        _, message = self._newest.pop("points_topic", (0.0, None))
        if message is None:
            return None
        points, frame = cloud.read_cloud(message), message.header.frame_id
        sensor = self.transforms.look_up(self._config.body_frame, frame)
        if sensor is None or sensor.age > _MOUNT_AGE:
            self.unplaced = frame
            return None
        return from_cloud(sensor.apply(points))


def speeds(twist: Any) -> Array:
    """Return forward speed and turn rate ``(2,)`` of a ``geometry_msgs/Twist``."""
    return np.array([twist.linear.x, twist.angular.z])


def _planar(pose: Any) -> Array:
    """Return ``(3,)`` m, m, rad of a ``geometry_msgs/Pose``."""
    return np.array([pose.position.x, pose.position.y, heading(pose.orientation)])
