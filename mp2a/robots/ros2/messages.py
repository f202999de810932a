"""The messages of ROS 2 that are used here, as types of DDS: what is on the wire, field by field.

From the ``.msg`` files of ROS 2's common_interfaces; ``dds_`` and the underscore are how ROS 2 names types on DDS.
"""

from typing import Any

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import array, float32, float64, int8, int32, sequence, uint8, uint32

ROS2_MESSAGES: dict[str, Any] = {}
"""Every type by its name in ROS 2; built of its fields in their order."""


def _message(kind: str, *, package_on_wire: str = "", **fields: Any) -> Any:
    """Add a type that has these fields, by name."""
    package, _, name = kind.split("/")
    made = make_idl_struct(name, f"{package_on_wire or package}::msg::dds_::{name}_", fields)
    ROS2_MESSAGES[kind] = made
    return made


_time = _message("builtin_interfaces/msg/Time", sec=int32, nanosec=uint32)
_header = _message("std_msgs/msg/Header", stamp=_time, frame_id=str)
_message("std_msgs/msg/String", data=str)
_message("std_msgs/msg/Bool", data=bool)
_vector = _message("geometry_msgs/msg/Vector3", x=float64, y=float64, z=float64)
_twist = _message("geometry_msgs/msg/Twist", linear=_vector, angular=_vector)
_message("geometry_msgs/msg/TwistStamped", header=_header, twist=_twist)
_point = _message("geometry_msgs/msg/Point", x=float64, y=float64, z=float64)
_quaternion = _message("geometry_msgs/msg/Quaternion", x=float64, y=float64, z=float64, w=float64)
_pose = _message("geometry_msgs/msg/Pose", position=_point, orientation=_quaternion)
_message("geometry_msgs/msg/PoseStamped", header=_header, pose=_pose)
_transform = _message("geometry_msgs/msg/Transform", translation=_vector, rotation=_quaternion)
_transform_stamped = _message(
    "geometry_msgs/msg/TransformStamped", header=_header, child_frame_id=str, transform=_transform
)
_message("tf2_msgs/msg/TFMessage", transforms=sequence[_transform_stamped])
_pose_covariance = _message("geometry_msgs/msg/PoseWithCovariance", pose=_pose, covariance=array[float64, 36])
_twist_covariance = _message("geometry_msgs/msg/TwistWithCovariance", twist=_twist, covariance=array[float64, 36])
_message("nav_msgs/msg/Odometry", header=_header, child_frame_id=str, pose=_pose_covariance, twist=_twist_covariance)
_field = _message("sensor_msgs/msg/PointField", name=str, offset=uint32, datatype=uint8, count=uint32)
_message(
    "sensor_msgs/msg/PointCloud2", header=_header, height=uint32, width=uint32, fields=sequence[_field],
    is_bigendian=bool, point_step=uint32, row_step=uint32, data=sequence[uint8], is_dense=bool,
)  # fmt: skip
_message(
    "sound_play/msg/SoundRequest", package_on_wire="sound_play_msgs", sound=int8, command=int8, volume=float32,
    arg=str, arg2=str,
)  # fmt: skip
