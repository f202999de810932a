r"""Six-dimensional operators of rigid-body motion (paper, eq. 1-3), on arrays with any leading axes.

A spatial vector is ``[angular; linear]`` as in the paper: velocity :math:`V = [\omega; v]`, force
:math:`F = [\tau; f]`. ``r`` (``(..., 3, 3)``) takes coordinates of a body's frame to its parent's frame and ``p``
(``(..., 3)``) is the body's origin seen from the parent's origin, in the parent's frame.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "GRAVITY",
    "body_force",
    "classical_to_spatial",
    "force_at_origin",
    "force_to_child",
    "force_to_parent",
    "inertia_at_origin",
    "motion_operator",
    "motion_to_child",
    "skew",
    "spatial_inertia",
    "spatial_to_classical",
    "to_linear_first",
    "velocity_product",
]

Array = NDArray[np.float64]

GRAVITY = (0.0, 0.0, -9.81)
"""Standard gravity field in the base frame, m/s², as pinocchio's default."""


def quaternion_matrix(x: Any, y: Any, z: Any, w: Any) -> tuple[Any, ...]:
    """Return the nine numbers, row by row, of the rotation of a unit quaternion, as Eigen's ``toRotationMatrix``.

    They are sums and products of anything that can be added and multiplied: numbers, arrays of them, or the symbols of
    `mp2a.kernels`.
    """
    tx, ty, tz = x + x, y + y, z + z
    return (
        1.0 - (ty * y + tz * z), tx * y - tz * w, tx * z + ty * w,
        tx * y + tz * w, 1.0 - (tx * x + tz * z), ty * z - tx * w,
        tx * z - ty * w, ty * z + tx * w, 1.0 - (tx * x + ty * y),
    )  # fmt: skip


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of ``(..., 3)`` arrays (several times faster than `numpy.cross` on small batches)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def skew(p: Array) -> Array:
    """Return the matrix ``(..., 3, 3)`` of the cross product with ``(..., 3)``: ``skew(p) @ x == cross(p, x)``."""
    out = np.zeros((*p.shape, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = p[..., 0], p[..., 1], p[..., 2]
    out[..., 1, 2], out[..., 2, 0], out[..., 0, 1] = -p[..., 0], -p[..., 1], -p[..., 2]
    return out


def apply(matrix: Array, vector: Array) -> Array:
    """Multiply matrices by vectors over the leading axes: ``(..., i, j)`` and ``(..., j)`` to ``(..., i)``."""
    out: Array = np.matmul(matrix, vector[..., None])[..., 0]
    return out


def transpose(matrix: Array) -> Array:
    """Transpose the last two axes, as a view."""
    return np.swapaxes(matrix, -1, -2)


def motion_operator(r: Array, p: Array) -> Array:
    """Return the operator ``Pᵀ Rᵀ`` that takes the parent's motion to the body's frame and origin (paper, eq. 4).

    Parameters
    ----------
    r, p
        Placement of the body in its parent, ``(..., 3, 3)`` and ``(..., 3)`` in metres.

    Returns
    -------
    numpy.ndarray
        ``(..., 6, 6)``. Its transpose is the paper's ``R P`` (eq. 6): it takes a force on the body to the
        parent's frame and origin.
    """
    rt = transpose(r)
    out = np.zeros((*p.shape[:-1], 6, 6))
    out[..., :3, :3] = rt
    out[..., 3:, 3:] = rt
    out[..., 3:, :3] = -rt @ skew(p)
    return out


def motion_to_child(r: Array, p: Array, motion: Array) -> Array:
    """Apply ``Pᵀ Rᵀ`` to a ``(..., 6)`` motion without forming the operator."""
    rt = transpose(r)
    angular, linear = motion[..., :3], motion[..., 3:]
    return np.concatenate((apply(rt, angular), apply(rt, linear + cross(angular, p))), axis=-1)


def force_to_parent(r: Array, p: Array, force: Array) -> Array:
    """Apply ``R P`` to a ``(..., 6)`` force: take it from the body's frame and origin to its parent's."""
    linear = apply(r, force[..., 3:])
    return np.concatenate((apply(r, force[..., :3]) + cross(p, linear), linear), axis=-1)


def force_to_child(r: Array, p: Array, force: Array) -> Array:
    """Undo `force_to_parent`."""
    rt = transpose(r)
    angular, linear = force[..., :3], force[..., 3:]
    return np.concatenate((apply(rt, angular - cross(p, linear)), apply(rt, linear)), axis=-1)


def force_at_origin(com: Array, force: Array) -> Array:
    r"""Move a force from the centre of mass to the body's origin: :math:`\hat S F` with eq. 2's operator.

    The paper prints :math:`\hat S^T F_{R,A}` (eq. 6); with :math:`\hat S` in the form of eq. 2 the transpose
    adds a torque to a force, so the untransposed operator is meant.

    Parameters
    ----------
    com
        The centre of mass in the body's frame, ``(..., 3)``, m.
    force
        ``[torque; force]`` about the centre of mass, body frame, ``(..., 6)``, N m and N.
    """
    angular, linear = force[..., :3], force[..., 3:]
    return np.concatenate((angular + cross(com, linear), np.broadcast_to(linear, angular.shape)), axis=-1)


def inertia_at_origin(mass: Array, com: Array, inertia: Array) -> Array:
    r"""Return the rotational inertia about the body's origin, :math:`J + m (s^T s\,1 - s s^T)`.

    Parameters
    ----------
    mass, com, inertia
        ``(...,)`` kg, ``(..., 3)`` m, ``(..., 3, 3)`` kg m² about the centre of mass, body frame.
    """
    s = skew(com)
    out: Array = inertia - mass[..., None, None] * (s @ s)
    return out


def spatial_inertia(mass: Array, com: Array, inertia: Array) -> Array:
    r"""Return the matrix ``M`` of eq. 6, :math:`[J, m \tilde s; -m \tilde s, m 1]`, about the body's origin.

    Parameters
    ----------
    mass, com, inertia
        As `body_force` takes them.

    Returns
    -------
    numpy.ndarray
        ``(..., 6, 6)``: acceleration ``[angular; linear]`` to force, kg m², kg m and kg.
    """
    moment = mass[..., None, None] * skew(com)
    out = np.zeros((*mass.shape, 6, 6))
    out[..., :3, :3], out[..., 3:, 3:] = inertia, mass[..., None, None] * np.eye(3)
    out[..., :3, 3:], out[..., 3:, :3] = moment, -moment
    return out


def body_force(mass: Array, com: Array, inertia: Array, velocity: Array, acceleration: Array) -> Array:
    r"""Return the force that moves a body, :math:`M \dot V + [\dot M - \dot{\hat S} M] V` (paper, eq. 6).

    Parameters
    ----------
    mass, com
        ``(...,)`` kg and centre of mass ``(..., 3)`` m in the body's frame.
    inertia
        Rotational inertia about the body's *origin*, ``(..., 3, 3)``, kg m².
    velocity, acceleration
        ``(..., 6)`` of the body's frame at its origin; the linear acceleration is the classical one, the
        derivative of the origin's velocity.

    Returns
    -------
    numpy.ndarray
        ``[torque; force]`` about the body's origin, ``(..., 6)``, N m and N.
    """
    w, dw, a = velocity[..., :3], acceleration[..., :3], acceleration[..., 3:]
    linear = mass[..., None] * (a + cross(dw, com) + cross(w, cross(w, com)))
    angular = apply(inertia, dw) + cross(w, apply(inertia, w)) + mass[..., None] * cross(com, a)
    return np.concatenate((angular, linear), axis=-1)


def velocity_product(p: Array, r: Array, parent_velocity: Array, relative: Array, velocity: Array) -> Array:
    r"""Return the Coriolis and centrifugal terms :math:`\dot P^T R^T V_{i-1} + \dot H_i \dot q_i` (paper, eq. 5).

    Parameters
    ----------
    p, r
        Placement of the body in its parent, ``(..., 3)`` and ``(..., 3, 3)``.
    parent_velocity
        ``Pᵀ Rᵀ V_{i-1}``, the parent's velocity already in the body's frame and origin, ``(..., 6)``.
    relative
        Joint velocity ``H q̇``, ``(..., 6)``, body frame.
    velocity
        The body's velocity ``V_i``, ``(..., 6)``.
    """
    w_parent, w = parent_velocity[..., :3], velocity[..., :3]
    p_body = apply(transpose(r), p)
    p_dot = cross(w_parent, p_body) + relative[..., 3:]
    linear = cross(w_parent, p_dot) + cross(w, relative[..., 3:])
    return np.concatenate((cross(w, relative[..., :3]), linear), axis=-1)


def to_linear_first(vector: Array) -> Array:
    """Reorder ``[angular; linear]`` to pinocchio's ``[linear; angular]`` or back, ``(..., 6)``."""
    return np.concatenate((vector[..., 3:], vector[..., :3]), axis=-1)


def classical_to_spatial(acceleration: Array, velocity: Array) -> Array:
    r"""Return the spatial acceleration (pinocchio's ``data.a``) of a classical one: :math:`a - \omega \times v` below.

    Both ``(..., 6)``, ``[angular; linear]``, in the body's frame.
    """
    out = acceleration.copy()
    out[..., 3:] -= cross(velocity[..., :3], velocity[..., 3:])
    return out


def spatial_to_classical(acceleration: Array, velocity: Array) -> Array:
    """Undo `classical_to_spatial`."""
    out = acceleration.copy()
    out[..., 3:] += cross(velocity[..., :3], velocity[..., 3:])
    return out
