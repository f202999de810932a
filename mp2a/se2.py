r"""Rigid motion in the plane: poses, and how frames move, batched (`mp2a.spatial` is the same in space).

A pose is ``(..., 3)``: x m, y m and heading rad of a frame in another one; headings are not wrapped. Poses are a group,
SE(2): `compose`, `inverse`, `relative`, and `act` on points ``(..., 2)``. A `PlanarMotion` is a pose with its first and
second derivative, and these are a group as well, by the methods of the same names.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.spatial import Array


def wrap(angle: Array) -> Array:
    """Return the same directions as angles between -π and π."""
    out: Array = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return out


def rotate(angle: ArrayLike, vectors: ArrayLike) -> Array:
    """Return vectors ``(..., 2)`` turned to the left by angles ``(...,)``."""
    c, s, v = np.cos(angle), np.sin(angle), np.asarray(vectors)
    return _columns(c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1])


def act(pose: ArrayLike, points: ArrayLike) -> Array:
    """Return the points ``(..., 2)`` of the frame at ``pose`` in the frame that the pose is given in."""
    frame = np.asarray(pose, dtype=float)
    out: Array = frame[..., :2] + rotate(frame[..., 2], points)
    return out


def act_inverse(pose: ArrayLike, points: ArrayLike) -> Array:
    """Return points ``(..., 2)`` as seen from the frame at ``pose``: the inverse of `act`."""
    frame = np.asarray(pose, dtype=float)
    return rotate(-frame[..., 2], np.asarray(points, dtype=float) - frame[..., :2])


def compose(pose: ArrayLike, step: ArrayLike) -> Array:
    """Return the pose of what is at ``step`` in the frame at ``pose``."""
    frame, inner = np.asarray(pose, dtype=float), np.asarray(step, dtype=float)
    return _pose(act(frame, inner[..., :2]), frame[..., 2] + inner[..., 2])


def relative(pose: ArrayLike, other: ArrayLike) -> Array:
    """Return the pose ``other`` as seen from the frame at ``pose``: ``compose(inverse(pose), other)``."""
    frame, outer = np.asarray(pose, dtype=float), np.asarray(other, dtype=float)
    return _pose(act_inverse(frame, outer[..., :2]), outer[..., 2] - frame[..., 2])


def inverse(pose: ArrayLike) -> Array:
    """Return the pose of the reference frame as seen from the frame at ``pose``."""
    return relative(pose, np.zeros(3))


def exp(step: ArrayLike) -> Array:
    """Return the pose after a motion with constant velocity, seen from where it began: exactly an arc.

    Parameters
    ----------
    step
        Velocity in the moving frame's own axes times the time it lasts, ``(..., 3)``: ahead m, to the left m, turn rad.
    """
    moved = np.asarray(step, dtype=float)
    half = moved[..., 2] / 2
    # An arc's chord is the arc times the sinc of half the turn, in the direction half way round.
    chord = np.sinc(half / np.pi)[..., None] * moved[..., :2]
    return _pose(rotate(half, chord), moved[..., 2])


def drive(twist: Array, time: float | Array) -> Array:
    """Return the `exp` of a robot that does not move sideways.

    Parameters
    ----------
    twist
        Forward speed and turn rate, ``(..., 2)``, m/s and rad/s.
    time
        Seconds it lasts, one number or ``(...,)``.
    """
    return exp(_columns(twist[..., 0] * time, np.zeros_like(twist[..., 0]), twist[..., 1] * time))


def mean_heading(angles: Array) -> float:
    """Return the direction of the mean of unit vectors, rad."""
    return float(np.arctan2(np.sin(angles).mean(), np.cos(angles).mean()))


class PlanarMotion(NamedTuple):
    """The motion of frames in a reference frame, or of planar joints: of children in their parents.

    Pose and velocity are the ``q`` and ``v`` of the planar joint in `mp2a.joints`, the pose with an angle in place of
    its cosine and sine.
    """

    pose: Array
    """``(..., 3)``, m, m, rad"""
    velocity: Array
    """``(..., 3)``, m/s, m/s, rad/s, in the frame's own axes"""
    rate: Array
    """Time derivative of the three numbers of ``velocity``, ``(..., 3)``, m/s², m/s², rad/s²"""

    @classmethod
    def at_rest(cls, pose: Array) -> "PlanarMotion":
        """Return the motion of frames that stand still."""
        return cls(pose, np.zeros_like(pose), np.zeros_like(pose))

    def compose(self, joint: "PlanarMotion") -> "PlanarMotion":
        """Return the motion of the children at the end of joints whose parents move like this."""
        carried = self._at(joint)
        pose = compose(self.pose, joint.pose)
        return PlanarMotion(pose, *(own + of_joint for own, of_joint in zip(carried, joint[1:], strict=True)))

    def relative(self, child: "PlanarMotion") -> "PlanarMotion":
        """Return the joints that tie children to parents that move like this."""
        pose = relative(self.pose, child.pose)
        still = np.zeros_like(pose)
        velocity = child.velocity - self._at(PlanarMotion(pose, still, still))[0]
        return PlanarMotion(pose, velocity, child.rate - self._at(PlanarMotion(pose, velocity, still))[1])

    def inverse(self) -> "PlanarMotion":
        """Return the motion of the reference frame as seen from these frames."""
        return self.relative(PlanarMotion.at_rest(np.zeros_like(self.pose)))

    def coordinates(self) -> Array:
        """Return ``q`` of planar joints, ``(..., 4)``: x, y, cosine and sine."""
        angle = self.pose[..., 2]
        return _columns(self.pose[..., 0], self.pose[..., 1], np.cos(angle), np.sin(angle))

    def _at(self, joint: "PlanarMotion") -> tuple[Array, Array]:
        """Return velocity and rate ``(..., 3)`` of the child, in its axes, apart from what the joint adds."""
        place, angle = joint.pose[..., :2], joint.pose[..., 2]
        spin, spin_rate = self.velocity[..., 2:], self.rate[..., 2:]
        place_rate = rotate(angle, joint.velocity[..., :2])
        there = self.velocity[..., :2] + spin * _left(place)
        there_rate = self.rate[..., :2] + spin_rate * _left(place) + spin * _left(place_rate)
        carried = rotate(-angle, there)
        carried_rate = rotate(-angle, there_rate) - joint.velocity[..., 2:] * _left(carried)
        return np.concatenate((carried, spin), axis=-1), np.concatenate((carried_rate, spin_rate), axis=-1)


def _left(vectors: Array) -> Array:
    """Return vectors ``(..., 2)`` turned to the left by a quarter: the cross product with the vertical."""
    return _columns(-vectors[..., 1], vectors[..., 0])


def _pose(position: Array, heading: Array) -> Array:
    return _columns(position[..., 0], position[..., 1], heading)


def _columns(*columns: Array) -> Array:
    """Return arrays beside one another, in a last axis of their own; the first has the shape of all.

    `numpy.stack` takes four times as long for the few numbers of a robot.
    """
    out = np.empty((*np.shape(columns[0]), len(columns)))
    for k, column in enumerate(columns):
        out[..., k] = column
    return out
