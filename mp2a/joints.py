r"""Joint types: how coordinates ``q`` place a body in its parent, and the subspace ``H`` its motion lies in.

Coordinates and velocities are pinocchio's, so that a user's ``q`` and ``v`` work in both:

============  ==  ==  ==============================  ======================================
name          nq  nv  q                               v
============  ==  ==  ==============================  ======================================
revolute      1   1   angle, rad                      rad/s
continuous    2   1   cos, sin of an unbounded angle  rad/s
prismatic     1   1   length, m                       m/s
planar        4   3   x, y, cos, sin                  vx, vy, turn rate; body frame
spherical     4   3   quaternion x, y, z, w           angular velocity, body frame
free          7   6   position, quaternion x, y, z, w linear, then angular velocity, body frame
============  ==  ==  ==============================  ======================================

``H`` is constant in the body's frame for every one of them, rows ``[angular; linear]``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.checks import read_only
from mp2a.spatial import Array, quaternion_matrix, skew
from mp2a.tangents import (
    Difference,
    Integrate,
    add,
    difference_circle,
    difference_free,
    difference_planar,
    difference_sphere,
    integrate_circle,
    integrate_free,
    integrate_planar,
    integrate_sphere,
    subtract,
)


@dataclass(frozen=True)
class Joint:
    """One joint type.

    Attributes
    ----------
    name
        The name in the table above.
    neutral
        The coordinates of zero displacement; its length is ``nq``.
    nv
        The number of degrees of freedom.
    transform
        ``(axis (k, 3), q (k, T, nq))`` to the rotation ``(k, T, 3, 3)`` and translation ``(k, T, 3)`` of the joint.
    subspace
        ``axis (k, 3)`` to ``H (k, 6, nv)``.
    integrate, difference
        Along a velocity, and back: see `mp2a.tangents`.
    unit
        The slice of ``q`` that has to have length one, if there is one.
    axial
        Whether the joint has an axis.
    """

    name: str
    neutral: tuple[float, ...]
    nv: int
    transform: Callable[[Array, Array], tuple[Array, Array]]
    subspace: Callable[[Array], Array]
    integrate: Integrate
    difference: Difference
    unit: slice | None = None
    axial: bool = False

    @property
    def nq(self) -> int:
        """The number of coordinates."""
        return len(self.neutral)


def _rotation(axis: Array, cosine: Array, sine: Array) -> Array:
    """Return rotations about ``axis`` (k, 3) by angles given as ``(k, T)`` cosines and sines (Rodrigues)."""
    outer = axis[:, None, :, None] * axis[:, None, None, :]
    c, s = cosine[..., None, None], sine[..., None, None]
    return c * np.eye(3) + s * skew(axis)[:, None] + (1.0 - c) * outer


def _quaternion(q: Array) -> Array:
    """Return rotations ``(..., 3, 3)`` of quaternions ``(..., 4)`` in the order x, y, z, w."""
    return np.stack(quaternion_matrix(*np.moveaxis(q, -1, 0)), axis=-1).reshape(*q.shape[:-1], 3, 3)


def _transform_revolute(axis: Array, q: Array) -> tuple[Array, Array]:
    angle = q[..., 0]
    return _rotation(axis, np.cos(angle), np.sin(angle)), np.zeros((*angle.shape, 3))


def _transform_continuous(axis: Array, q: Array) -> tuple[Array, Array]:
    return _rotation(axis, q[..., 0], q[..., 1]), np.zeros((*q.shape[:-1], 3))


def _transform_prismatic(axis: Array, q: Array) -> tuple[Array, Array]:
    return np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3)), axis[:, None, :] * q


def _transform_planar(axis: Array, q: Array) -> tuple[Array, Array]:
    z = np.broadcast_to([0.0, 0.0, 1.0], axis.shape)
    p = np.zeros((*q.shape[:-1], 3))
    p[..., :2] = q[..., :2]
    return _rotation(z, q[..., 2], q[..., 3]), p


def _transform_spherical(axis: Array, q: Array) -> tuple[Array, Array]:
    return _quaternion(q), np.zeros((*q.shape[:-1], 3))


def _transform_free(axis: Array, q: Array) -> tuple[Array, Array]:
    return _quaternion(q[..., 3:]), q[..., :3]


def _angular_axis(axis: Array) -> Array:
    return np.concatenate((axis, np.zeros_like(axis)), axis=-1)[..., None]


def _linear_axis(axis: Array) -> Array:
    return np.concatenate((np.zeros_like(axis), axis), axis=-1)[..., None]


def _columns(*rows: int) -> Callable[[Array], Array]:
    """Make a subspace that selects spatial components: column j is the unit vector of component ``rows[j]``."""
    matrix = np.eye(6)[:, list(rows)]
    return lambda axis: np.broadcast_to(matrix, (len(axis), *matrix.shape))


_QUATERNION = (0.0, 0.0, 0.0, 1.0)
_LINE, _CIRCLE, _PLANE = (add, subtract), (integrate_circle, difference_circle), (integrate_planar, difference_planar)
_SPHERE, _SPACE = (integrate_sphere, difference_sphere), (integrate_free, difference_free)
_JOINTS = (
    Joint("revolute", (0.0,), 1, _transform_revolute, _angular_axis, *_LINE, axial=True),
    Joint("continuous", (1.0, 0.0), 1, _transform_continuous, _angular_axis, *_CIRCLE, unit=slice(0, 2), axial=True),
    Joint("prismatic", (0.0,), 1, _transform_prismatic, _linear_axis, *_LINE, axial=True),
    Joint("planar", (0.0, 0.0, 1.0, 0.0), 3, _transform_planar, _columns(3, 4, 2), *_PLANE, unit=slice(2, 4)),
    Joint("spherical", _QUATERNION, 3, _transform_spherical, _columns(0, 1, 2), *_SPHERE, unit=slice(0, 4)),
    Joint(
        "free", (0.0, 0.0, 0.0, *_QUATERNION), 6, _transform_free, _columns(3, 4, 5, 0, 1, 2), *_SPACE,
        unit=slice(3, 7),
    ),
)  # fmt: skip

JOINTS = {joint.name: joint for joint in _JOINTS}
"""Every joint type by name. A new type is one more entry of ``_JOINTS``."""


class JointGroup(NamedTuple):
    """All bodies of one joint type, so that a type is computed in one go."""

    joint: Joint
    bodies: NDArray[np.intp]
    """``(k,)``"""
    q_columns: NDArray[np.intp]
    """``(k, nq)`` columns of the model's q."""
    v_columns: NDArray[np.intp]
    """``(k, nv)`` columns of the model's v."""
    axes: Array
    """``(k, 3)``"""
    subspace: Array
    """``H``, ``(k, 6, nv)``"""


def joint_groups(
    joints: Sequence[str], axes: Array, q_starts: NDArray[np.intp], v_starts: NDArray[np.intp]
) -> tuple[JointGroup, ...]:
    """Group bodies by the types of their joints, in read-only arrays; for `mp2a.Model.groups`."""
    kinds, groups = np.array(joints), []
    for joint in JOINTS.values():
        bodies = np.flatnonzero(kinds == joint.name)
        if bodies.size:
            q_columns = q_starts[bodies, None] + np.arange(joint.nq)
            v_columns = v_starts[bodies, None] + np.arange(joint.nv)
            arrays = bodies, q_columns, v_columns, axes[bodies], joint.subspace(axes[bodies])
            groups.append(JointGroup(joint, *map(read_only, arrays)))
    return tuple(groups)
