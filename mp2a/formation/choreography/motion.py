"""The formation as a chain of planar joints, so that the library's scan takes the leader's motion to every robot.

Body i is robot i where it is to be, its joint its place in the robot before (the first robot's in the ground). Robots
of one leader form a rigid body: all joints but the first stand still, and what moves them comes through the chain.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.chain import Chain
from mp2a.formation.choreography.places import compose, seen_from
from mp2a.spatial import Array


class Motion(NamedTuple):
    """Motion of n planar bodies, with any leading axes.

    Attributes
    ----------
    pose
        ``(..., n, 3)`` in the ground frame, m and rad.
    velocity
        ``(..., n, 3)``: vx, vy, turn rate in each body's own frame, m/s and rad/s.
    acceleration
        ``(..., n, 3)``: time derivatives of these three numbers.
    """

    pose: Array
    velocity: Array
    acceleration: Array


def place_motion(pose: ArrayLike, twist: ArrayLike, place: ArrayLike, acceleration: ArrayLike = (0.0, 0.0)) -> Motion:
    """Motion of places that are rigidly tied to their leaders.

    Parameters
    ----------
    pose, twist
        Of each robot's leader, ``(..., n, 3)`` and ``(..., n, 2)``.
    place
        x and y in the leader's frame, ``(..., n, 2)`` m.
    acceleration
        Time derivative of the twist, ``(..., n, 2)``; zero is right for virtual leaders between two ticks.

    Returns
    -------
    Motion
        Of the places.
    """
    speed, turn = np.moveaxis(np.asarray(twist, dtype=float), -1, 0)
    gain, bend = np.moveaxis(np.broadcast_to(np.asarray(acceleration, dtype=float), np.shape(twist)), -1, 0)
    x, y = np.moveaxis(np.asarray(place, dtype=float), -1, 0)
    step = np.stack((x, y, np.zeros_like(x)), axis=-1)
    return Motion(
        compose(pose, step),
        np.stack((speed - turn * y, turn * x, turn), axis=-1),
        np.stack((gain - bend * y, bend * x, bend), axis=-1),
    )


def joint_state(motion: Motion) -> tuple[Array, Array, Array]:
    """Coordinates, velocities and accelerations of the planar joints between each body and the one before.

    Parameters
    ----------
    motion
        Of n bodies in the ground frame.

    Returns
    -------
    tuple of numpy.ndarray
        q ``(..., 4 n)`` (x, y, cos, sin), v and a ``(..., 3 n)`` as `mp2a.joints` has them. Robot i's own columns,
        ``4 i`` and ``3 i`` on, are what it gives to `mp2a.DistributedChain.rnea`.
    """
    before = Motion(*(_shifted(x) for x in motion))
    d = seen_from(before.pose, motion.pose[..., :2])
    angle = motion.pose[..., 2] - before.pose[..., 2]
    turn = motion.velocity[..., 2:] - before.velocity[..., 2:]
    # What the joint's place would do if it were tied to the body before, in that body's frame.
    carried = before.velocity[..., :2] + before.velocity[..., 2:] * _left(d)
    linear = motion.velocity[..., :2] - _back(angle, carried)
    change = before.acceleration[..., :2] + before.acceleration[..., 2:] * _left(d)
    change = change + before.velocity[..., 2:] * _left(_back(-angle, linear))
    a_linear = motion.acceleration[..., :2] + turn * _left(_back(angle, carried)) - _back(angle, change)
    a_turn = motion.acceleration[..., 2:] - before.acceleration[..., 2:]
    q = np.concatenate((d, np.cos(angle)[..., None], np.sin(angle)[..., None]), axis=-1)
    v = np.concatenate((linear, turn), axis=-1)
    a = np.concatenate((a_linear, a_turn), axis=-1)
    return tuple(x.reshape(*x.shape[:-2], -1) for x in (q, v, a))  # type: ignore[return-value]


def planar_chain(n: int) -> Chain:
    """Chain of n bodies of 1 kg with planar joints, for `joint_state`; motion does not depend on the masses."""
    return Chain.uniform(n, joint="planar", offset=(0.0, 0.0, 0.0), inertia=np.eye(3))


def _shifted(x: Array) -> Array:
    """Take the body before each; the ground, at rest, before the first."""
    return np.concatenate((np.zeros_like(x[..., :1, :]), x[..., :-1, :]), axis=-2)


def _left(x: Array) -> Array:
    """Turn ``(..., 2)`` by 90° to the left."""
    return np.stack((-x[..., 1], x[..., 0]), axis=-1)


def _back(angle: Array, x: Array) -> Array:
    """Turn ``(..., 2)`` by ``-angle``."""
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return c * x - s * _left(x)
