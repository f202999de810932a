"""Coordinates of joints along their own motion: where a velocity leads in unit time, and which leads somewhere.

Velocities are in the moving body's frame, as pinocchio's: a joint that goes on with ``v`` for a unit of time comes from
``q`` to `integrate` of them, exactly, along the one-parameter subgroup of its motions, and `difference` undoes that.
"""

from collections.abc import Callable

import numpy as np

from mp2a.spatial import Array, apply, cross, quaternion_matrix, skew, transpose

Integrate = Callable[[Array, Array], Array]
"""``(q (..., nq), v (..., nv))`` to coordinates ``(..., nq)``."""

Difference = Callable[[Array, Array], Array]
"""``(from (..., nq), to (..., nq))`` to a velocity ``(..., nv)``."""

_SMALL = 1e-4
"""Squared angle, rad², below which the series are exact to rounding."""


def add(q: Array, v: Array) -> Array:
    """Integrate a coordinate of a line."""
    return q + v


def subtract(start: Array, end: Array) -> Array:
    """Undo `add`."""
    return end - start


def integrate_circle(q: Array, v: Array) -> Array:
    """Integrate (cosine, sine) ``(..., 2)`` by an angle ``(..., 1)``."""
    c, s = np.cos(v[..., 0]), np.sin(v[..., 0])
    return _unit(np.stack((q[..., 0] * c - q[..., 1] * s, q[..., 1] * c + q[..., 0] * s), axis=-1))


def difference_circle(start: Array, end: Array) -> Array:
    """Undo `integrate_circle`, for angles within π."""
    sine = start[..., 0] * end[..., 1] - start[..., 1] * end[..., 0]
    return np.arctan2(sine, np.sum(start * end, axis=-1))[..., None]


def integrate_planar(q: Array, v: Array) -> Array:
    """Integrate x, y, cosine, sine ``(..., 4)`` by vx, vy, turn ``(..., 3)``: along an arc."""
    step = _arc(v[..., 2], v[..., :2])
    c, s = q[..., 2], q[..., 3]
    place = q[..., :2] + np.stack((c * step[..., 0] - s * step[..., 1], s * step[..., 0] + c * step[..., 1]), axis=-1)
    return np.concatenate((place, integrate_circle(q[..., 2:], v[..., 2:])), axis=-1)


def difference_planar(start: Array, end: Array) -> Array:
    """Undo `integrate_planar`."""
    turn = difference_circle(start[..., 2:], end[..., 2:])
    c, s = start[..., 2], start[..., 3]
    x, y = np.moveaxis(end[..., :2] - start[..., :2], -1, 0)
    seen = np.stack((c * x + s * y, c * y - s * x), axis=-1)
    half = turn / 2
    # The inverse of the arc: half a turn back, and its cotangent along.
    along = np.where(np.abs(half) < np.sqrt(_SMALL), 1 - half**2 / 3 - half**4 / 45, half / np.tan(_not_zero(half)))
    sideways = np.stack((seen[..., 1], -seen[..., 0]), axis=-1)
    return np.concatenate((along * seen + half * sideways, turn), axis=-1)


def integrate_sphere(q: Array, v: Array) -> Array:
    """Integrate a quaternion x, y, z, w ``(..., 4)`` by an angular velocity ``(..., 3)``."""
    square = np.sum(v * v, axis=-1, keepdims=True)
    half = np.sqrt(square) / 2
    shrunk = np.where(square < _SMALL, 0.5 - square / 48 + square**2 / 3840, np.sin(half) / _not_zero(2 * half))
    x, w = shrunk * v, np.cos(half)
    imaginary, real = q[..., :3], q[..., 3:]
    turned = real * x + w * imaginary + cross(imaginary, x)
    found = np.concatenate((turned, real * w - np.sum(imaginary * x, axis=-1, keepdims=True)), axis=-1)
    # Of the two quaternions of a rotation the one that is near.
    return _unit(np.where(np.sum(found * q, axis=-1, keepdims=True) < 0, -found, found))


def difference_sphere(start: Array, end: Array) -> Array:
    """Undo `integrate_sphere`, for turns within π."""
    x, w = start[..., :3], start[..., 3:]
    y, u = end[..., :3], end[..., 3:]
    imaginary, real = w * y - u * x - cross(x, y), w * u + np.sum(x * y, axis=-1, keepdims=True)
    imaginary = np.where(real < 0, -imaginary, imaginary)
    sine = np.linalg.norm(imaginary, axis=-1, keepdims=True)
    stretched = np.where(sine**2 < 1e-12, 2 + sine**2 / 3, 2 * np.arctan2(sine, np.abs(real)) / _not_zero(sine))
    return stretched * imaginary


def integrate_free(q: Array, v: Array) -> Array:
    """Integrate position and quaternion ``(..., 7)`` by linear and angular velocity ``(..., 6)``: along a screw."""
    w, square = v[..., 3:], np.sum(v[..., 3:] ** 2, axis=-1)[..., None, None]
    angle = np.sqrt(square)
    first = np.where(square < _SMALL, 0.5 - square / 24 + square**2 / 720, (1 - np.cos(angle)) / _not_zero(square))
    second = np.where(
        square < _SMALL, 1 / 6 - square / 120 + square**2 / 5040, (angle - np.sin(angle)) / _not_zero(square * angle)
    )
    turning = skew(w)
    step = apply(np.eye(3) + first * turning + second * turning @ turning, v[..., :3])
    place = q[..., :3] + apply(_rotation(q[..., 3:]), step)
    return np.concatenate((place, integrate_sphere(q[..., 3:], w)), axis=-1)


def difference_free(start: Array, end: Array) -> Array:
    """Undo `integrate_free`."""
    w = difference_sphere(start[..., 3:], end[..., 3:])
    square = np.sum(w**2, axis=-1)[..., None, None]
    half = np.sqrt(square) / 2
    series, closed = 1 / 12 + square / 720 + square**2 / 30240, (1 - half / np.tan(_not_zero(half))) / _not_zero(square)
    rest = np.where(square < _SMALL, series, closed)
    turning = skew(w)
    seen = apply(transpose(_rotation(start[..., 3:])), end[..., :3] - start[..., :3])
    return np.concatenate((apply(np.eye(3) - turning / 2 + rest * turning @ turning, seen), w), axis=-1)


def _arc(turn: Array, velocity: Array) -> Array:
    """Displacement ``(..., 2)`` after a velocity in the plane ``(..., 2)`` that turns with its body by ``(...,)``."""
    small, safe = turn**2 < _SMALL, _not_zero(turn)
    along = np.where(small, 1 - turn**2 / 6 + turn**4 / 120, np.sin(turn) / safe)
    sideways = np.where(small, turn / 2 - turn**3 / 24 + turn**5 / 720, (1 - np.cos(turn)) / safe)
    x, y = velocity[..., 0], velocity[..., 1]
    return np.stack((along * x - sideways * y, sideways * x + along * y), axis=-1)


def _rotation(quaternion: Array) -> Array:
    return np.stack(quaternion_matrix(*np.moveaxis(quaternion, -1, 0)), axis=-1).reshape(*quaternion.shape[:-1], 3, 3)


def _unit(values: Array) -> Array:
    out: Array = values / np.linalg.norm(values, axis=-1, keepdims=True)
    return out


def _not_zero(values: Array) -> Array:
    """Numbers to divide by, also where a series is taken instead."""
    return np.where(values == 0, 1.0, values)
