"""Formulas of joints in the frames of their bodies, each under the name of its kernel.

A path across a joint is one of `mp2a.algebra.motion`, 24 numbers. ``joint`` is the rotation and the translation of the
joint's frame in the parent's, and the joint's axis, 15 numbers. Only building the kernels imports this module.
"""

from typing import Any

from mp2a.kernels.algebra import Numbers, add, apply, product
from mp2a.kernels.trigonometry import sine_and_cosine
from mp2a.spatial import quaternion_matrix


def path_revolute(q: Numbers, v: Numbers, a: Numbers, joint: Numbers) -> Numbers:
    """Return the path across a joint that turns by an angle."""
    sine, cosine = sine_and_cosine(q[0])
    return path_continuous((cosine, sine), v, a, joint)


def path_continuous(q: Numbers, v: Numbers, a: Numbers, joint: Numbers) -> Numbers:
    """Return the path across a joint that turns by an angle given as cosine and sine."""
    rest, place, axis = joint[0:9], joint[9:12], joint[12:15]
    zero = v[0].constant(0.0)
    shift = tuple(zero + x for x in place)
    return _path(product(rest, _turn(axis, *q)), shift, _along(axis, v[0], zero, 0), _along(axis, a[0], zero, 0))


def path_prismatic(q: Numbers, v: Numbers, a: Numbers, joint: Numbers) -> Numbers:
    """Return the path across a joint that slides."""
    rest, place, axis = joint[0:9], joint[9:12], joint[12:15]
    zero = v[0].constant(0.0)
    rotation = tuple(zero + x for x in rest)
    slid = add(place, apply(rest, tuple(x * q[0] for x in axis)))
    return _path(rotation, slid, _along(axis, v[0], zero, 3), _along(axis, a[0], zero, 3))


def path_planar(q: Numbers, v: Numbers, a: Numbers, joint: Numbers) -> Numbers:
    """Return the path across a joint with x, y and an angle about z, given as cosine and sine."""
    rest, place = joint[0:9], joint[9:12]
    x, y, c, s = q
    zero, one = c.constant(0.0), c.constant(1.0)
    turn = (c, -s, zero, s, c, zero, zero, zero, one)
    slid = add(place, apply(rest, (x, y, zero)))
    rates = [(zero, zero, of[2], of[0], of[1], zero) for of in (v, a)]
    return _path(product(rest, turn), slid, *rates)


def path_spherical(q: Numbers, v: Numbers, a: Numbers, joint: Numbers) -> Numbers:
    """Return the path across a joint that turns as a quaternion says."""
    zero = v[0].constant(0.0)
    nothing, place = (zero,) * 3, tuple(zero + x for x in joint[9:12])
    return _path(product(joint[0:9], quaternion_matrix(*q)), place, v + nothing, a + nothing)


def path_free(q: Numbers, v: Numbers, a: Numbers, joint: Numbers) -> Numbers:
    """Return the path across a joint that lets its body move anywhere."""
    rest = joint[0:9]
    slid = add(joint[9:12], apply(rest, q[0:3]))
    return _path(product(rest, quaternion_matrix(*q[3:7])), slid, v[3:6] + v[0:3], a[3:6] + a[0:3])


def torque_revolute(force: Numbers, axis: Numbers) -> Numbers:
    """Return the torque about an axis."""
    return (force[0] * axis[0] + force[1] * axis[1] + force[2] * axis[2],)


torque_continuous = torque_revolute


def torque_prismatic(force: Numbers, axis: Numbers) -> Numbers:
    """Return the force along an axis."""
    return torque_revolute(force[3:6], axis)


def torque_planar(force: Numbers, axis: Numbers) -> Numbers:
    """Return the forces along x and y, and the torque about z."""
    return force[3], force[4], force[2]


def torque_spherical(force: Numbers, axis: Numbers) -> Numbers:
    """Return the torque."""
    return force[0:3]


def torque_free(force: Numbers, axis: Numbers) -> Numbers:
    """Return the force, then the torque."""
    return force[3:6] + force[0:3]


def _path(rotation: Numbers, place: Numbers, velocity: Numbers, acceleration: Numbers) -> Numbers:
    return (*rotation, *place, *velocity, *acceleration)


def _along(axis: Numbers, rate: Any, zero: Any, first: int) -> Numbers:
    """Return a spatial vector with a multiple of the axis from a component on."""
    along = tuple(x * rate for x in axis)
    return along + (zero,) * 3 if first == 0 else (zero,) * 3 + along


def _turn(axis: Numbers, cosine: Any, sine: Any) -> Numbers:
    """Return the rotation about an axis (Rodrigues)."""
    x, y, z = axis
    rest = 1.0 - cosine
    return (
        cosine + rest * (x * x), rest * (x * y) - sine * z, rest * (x * z) + sine * y,
        rest * (x * y) + sine * z, cosine + rest * (y * y), rest * (y * z) - sine * x,
        rest * (x * z) - sine * y, rest * (y * z) + sine * x, cosine + rest * (z * z),
    )  # fmt: skip
