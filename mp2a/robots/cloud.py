"""Points out of and into a ``sensor_msgs/PointCloud2``, whichever ROS it comes by."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mp2a.exceptions import InputError
from mp2a.spatial import Array

_FLOAT32 = 7
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", _FLOAT32: "f4", 8: "f8"}
"""PointField's constants as numpy types."""


def read_cloud(cloud: Any) -> Array:
    """Return the points ``(k, 3)`` of a cloud, m, in the cloud's frame; those that are not finite are left out.

    Raises
    ------
    InputError
        If the cloud has no x, y or z, one of an unknown type, or less data than it says.
    """
    data = bytes(cloud.data)
    if cloud.height == 0 or cloud.width == 0:
        return np.empty((0, 3))
    columns = [_column(cloud, data, name) for name in "xyz"]
    out = np.stack(columns, axis=-1).reshape(-1, 3).astype(np.float64)
    return out[np.isfinite(out).all(axis=1)]


def cloud_fields(points: Array, header: Any, field: Callable[..., Any]) -> tuple[Any, ...]:
    """Return the fields, in their order, of the cloud that holds some points.

    Parameters
    ----------
    points
        ``(k, 3)`` m.
    header
        ``std_msgs/Header`` with the points' frame.
    field
        Makes a ``sensor_msgs/PointField`` of its fields.
    """
    k = len(points)
    columns = [field(name, 4 * i, _FLOAT32, 1) for i, name in enumerate("xyz")]
    return header, 1, k, columns, False, 12, 12 * k, points.astype("<f4").tobytes(), True


def _column(cloud: Any, data: bytes, name: str) -> np.ndarray:
    field = next((field for field in cloud.fields if field.name == name), None)
    if field is None:
        names = ", ".join(field.name for field in cloud.fields) or "none"
        raise InputError(f"cloud: got fields {names}, expected x, y and z among them")
    if field.datatype not in _TYPES:
        raise InputError(f"cloud: got type {field.datatype} for field {name}, expected 1 to 8")
    kind = np.dtype((">" if cloud.is_bigendian else "<") + _TYPES[field.datatype])
    last = (cloud.height - 1) * cloud.row_step + (cloud.width - 1) * cloud.point_step + field.offset + kind.itemsize
    if last > len(data):
        raise InputError(f"cloud: got {len(data)} bytes of data, expected at least {last}")
    return np.ndarray((cloud.height, cloud.width), kind, data, field.offset, (cloud.row_step, cloud.point_step))
