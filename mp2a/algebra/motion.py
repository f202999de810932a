r"""Motion across a path of bodies: the segment that "sweep" and "compact" scan outwards (theory, section 4).

A path from a body to one further out takes the upper body's motion to the lower one's, whatever the upper one does:

.. math:: U = X V, \quad V' = U + v, \quad \dot V' = X \dot V + a + U \times v

with the placement X of the lower body in the upper one's frame and, in the lower body's frame, its velocity v and
*spatial* acceleration a as seen from the upper body. Two paths one after the other are a path again. A segment is 24
numbers a sample, ``(..., 24)``: rotation (9, lower to upper frame), translation (3, in the upper frame), v (6), a (6).
"""

from typing import NamedTuple

import numpy as np

from mp2a.joint_kinematics import JointMotion
from mp2a.spatial import Array, apply, cross, motion_to_child

DOUBLES = 24

IDENTITY = np.zeros(DOUBLES)
"""The path of no length at rest, which composed with another one leaves it as it is."""
IDENTITY[[0, 4, 8]] = 1.0
IDENTITY.flags.writeable = False


class RelativeMotion(NamedTuple):
    """Parts of a segment ``(..., 24)``, as views of it."""

    rotation: Array
    """``(..., 3, 3)``"""
    translation: Array
    """``(..., 3)``, m"""
    velocity: Array
    """v, ``(..., 6)``"""
    acceleration: Array
    """a, ``(..., 6)``"""


def view(segment: Array) -> RelativeMotion:
    """Name the parts of a segment."""
    rotation = segment[..., :9].reshape(*segment.shape[:-1], 3, 3)
    return RelativeMotion(rotation, segment[..., 9:12], segment[..., 12:18], segment[..., 18:24])


def from_joint(joint: JointMotion) -> Array:
    """Segment from a body's parent to the body, ``(n, T, 24)``: X and H q̇, H q̈ of its own joint."""
    flat = joint.rotation.reshape(*joint.rotation.shape[:-2], 9)
    return np.concatenate((flat, joint.translation, joint.velocity, joint.acceleration), axis=-1)


def compose(upper: Array, lower: Array) -> Array:
    """Put a path above another one: ``(X₂ X₁, X₂ v₁ + v₂, X₂ a₁ + a₂ + X₂ v₁ × v₂)``; associative."""
    one, two = view(upper), view(lower)
    out = np.empty(np.broadcast_shapes(upper.shape, lower.shape))
    both = view(out)
    np.matmul(one.rotation, two.rotation, out=both.rotation)
    both.translation[...] = one.translation + apply(one.rotation, two.translation)
    carried = motion_to_child(two.rotation, two.translation, one.velocity)
    both.velocity[...] = carried + two.velocity
    turned = motion_to_child(two.rotation, two.translation, one.acceleration)
    both.acceleration[...] = turned + two.acceleration + motion_cross(carried, two.velocity)
    return out


def acceleration_from_base(path: Array, gravity: Array) -> Array:
    """Spatial acceleration ``(..., 6)`` of bodies whose paths reach the base, which falls with -g.

    Parameters
    ----------
    path
        From the base to the bodies, ``(..., 24)``; its velocity is theirs.
    gravity
        ``(3,)`` m/s² in the base frame.
    """
    whole = view(path)
    acceleration = whole.acceleration.copy()
    acceleration[..., 3:] -= gravity @ whole.rotation
    return acceleration


def motion_cross(motion: Array, other: Array) -> Array:
    """Spatial cross product of motions, ``V × W``, ``(..., 6)``."""
    w, v = motion[..., :3], motion[..., 3:]
    angular, linear = other[..., :3], other[..., 3:]
    return np.concatenate((cross(w, angular), cross(w, linear) + cross(v, angular)), axis=-1)
