r"""Motion in the plane: poses, rates, and what a planar joint does between two of them, batched.

A frame's motion is its pose (x, y, heading), its velocity in its own axes (vx, vy, turn rate) and the rate of change of
these three numbers. A planar joint has the same three: place of the child in the parent's frame, and velocity relative
to the parent in the child's axes, which are the ``q`` and ``v`` of `mp2a.joints`. Vectors are complex numbers inside:
a turn by α multiplies by :math:`e^{i α}`, a cross product with the vertical by i.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array

Complex = NDArray[np.complex128]


class Motion(NamedTuple):
    """Motion of frames in the ground frame, or of planar joints."""

    pose: Array
    """``(..., 3)``, m, m, rad"""
    velocity: Array
    """``(..., 3)``, m/s, m/s, rad/s, in the frame's own axes"""
    rate: Array
    """Time derivative of ``velocity``, ``(..., 3)``, m/s², m/s², rad/s²"""


def point(values: Array) -> Complex:
    """First two of ``(..., 3)`` numbers as complex ones."""
    out: Complex = values[..., 0] + 1j * values[..., 1]
    return out


def triple(vector: Complex, last: Array) -> Array:
    """Inverse of `point`, with the third number."""
    return np.stack((vector.real, vector.imag, last), axis=-1)


def turn(angle: Array) -> Complex:
    """Rotation by an angle as a complex number."""
    out: Complex = np.exp(1j * angle)
    return out


def wrap(angle: Array) -> Array:
    """Angle between -π and π."""
    out: Array = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return out


def at_rest(pose: Array) -> Motion:
    """Motion of a frame that stands still."""
    return Motion(pose, np.zeros_like(pose), np.zeros_like(pose))


def beyond(parent: Motion, joint: Motion) -> Motion:
    """Motion of the child at the end of a joint."""
    p, spin, spin_rate = point(joint.pose), parent.velocity[..., 2], parent.rate[..., 2]
    pose = triple(point(parent.pose) + turn(parent.pose[..., 2]) * p, parent.pose[..., 2] + joint.pose[..., 2])
    carried, carried_rate = _carried(parent, joint)
    velocity = triple(carried + point(joint.velocity), spin + joint.velocity[..., 2])
    rate = triple(carried_rate + point(joint.rate), spin_rate + joint.rate[..., 2])
    return Motion(pose, velocity, rate)


def between(parent: Motion, child: Motion) -> Motion:
    """Joint that ties a child to a parent; the inverse of `beyond` in its second argument."""
    p = turn(-parent.pose[..., 2]) * (point(child.pose) - point(parent.pose))
    pose = triple(p, child.pose[..., 2] - parent.pose[..., 2])
    no_rate = np.zeros_like(pose)
    carried, _ = _carried(parent, Motion(pose, no_rate, no_rate))
    velocity = triple(point(child.velocity) - carried, child.velocity[..., 2] - parent.velocity[..., 2])
    _, carried_rate = _carried(parent, Motion(pose, velocity, no_rate))
    rate = triple(point(child.rate) - carried_rate, child.rate[..., 2] - parent.rate[..., 2])
    return Motion(pose, velocity, rate)


def before(child: Motion, joint: Motion) -> Motion:
    """Motion of the parent at the start of a joint; the inverse of `beyond` in its first argument."""
    angle, relative = joint.pose[..., 2], joint.velocity[..., 2]
    p = point(joint.pose)
    heading = child.pose[..., 2] - angle
    pose = triple(point(child.pose) - turn(heading) * p, heading)
    spin, spin_rate = child.velocity[..., 2] - relative, child.rate[..., 2] - joint.rate[..., 2]
    carried = point(child.velocity) - point(joint.velocity)
    there = turn(angle) * carried
    velocity = there - 1j * spin * p
    # d/dt of `carried` is the child's rate less the joint's; back in the parent's axes the turning of the joint adds.
    there_rate = turn(angle) * (point(child.rate) - point(joint.rate)) + 1j * relative * there
    p_rate = turn(angle) * point(joint.velocity)
    rate = there_rate - 1j * (spin_rate * p + spin * p_rate)
    return Motion(pose, triple(velocity, spin), triple(rate, spin_rate))


def coordinates(joint: Motion) -> Array:
    """``q`` of planar joints, ``(..., 4)``: x, y, cosine and sine."""
    x, y, angle = np.moveaxis(joint.pose, -1, 0)
    return np.stack((x, y, np.cos(angle), np.sin(angle)), axis=-1)


def _carried(parent: Motion, joint: Motion) -> tuple[Complex, Complex]:
    """Velocity of the parent at the child's place, in the child's axes, and its rate."""
    back = turn(-joint.pose[..., 2])
    p, spin = point(joint.pose), parent.velocity[..., 2]
    p_rate = turn(joint.pose[..., 2]) * point(joint.velocity)
    there = point(parent.velocity) + 1j * spin * p
    there_rate = point(parent.rate) + 1j * (parent.rate[..., 2] * p + spin * p_rate)
    carried = back * there
    return carried, back * there_rate - 1j * joint.velocity[..., 2] * carried
