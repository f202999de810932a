"""Where each robot of a formation stands, seen from its virtual leader (thesis, section 4.2 and chapter 6)."""

import itertools

import numpy as np
from numpy.typing import ArrayLike

from mp2a.formation.choreography.constants import LEADER_LEAD
from mp2a.formation.choreography.scenario import Shape
from mp2a.spatial import Array


def places(shape: Shape) -> dict[str, tuple[float, float]]:
    """Places of a formation's robots in the frame of its virtual leader.

    The leader is `LEADER_LEAD` in front of the first row and in the middle across; every row is centred on it.

    Parameters
    ----------
    shape
        Of which robots, and how far apart.

    Returns
    -------
    dict
        x (negative: behind the leader) and y (to the left) by role, m.

    Examples
    --------
    >>> places(Shape("row", (("R1", "R2"),), (), ((1.2,),)))
    {'R1': (-0.5, 0.6), 'R2': (-0.5, -0.6)}
    """
    out = {}
    back = itertools.accumulate((LEADER_LEAD, *shape.distances))
    for row, gaps, x in zip(shape.rows, shape.spacings, back, strict=True):
        left = sum(gaps) / 2
        for robot, across in zip(row, itertools.accumulate((0.0, *gaps)), strict=True):
            out[robot] = (-x, left - across)
    return out


def compose(pose: ArrayLike, step: ArrayLike) -> Array:
    """Pose of what is at ``step`` in the frame at ``pose``; both ``(..., 3)``, m and rad, headings added."""
    frame, inner = np.asarray(pose, dtype=float), np.asarray(step, dtype=float)
    c, s = np.cos(frame[..., 2]), np.sin(frame[..., 2])
    x = frame[..., 0] + c * inner[..., 0] - s * inner[..., 1]
    y = frame[..., 1] + s * inner[..., 0] + c * inner[..., 1]
    return np.stack(np.broadcast_arrays(x, y, frame[..., 2] + inner[..., 2]), axis=-1)


def seen_from(pose: ArrayLike, point: ArrayLike) -> Array:
    """Points ``(..., 2)`` of the ground in the frame at ``pose`` ``(..., 3)``."""
    frame = np.asarray(pose, dtype=float)
    offset = np.asarray(point, dtype=float) - frame[..., :2]
    c, s = np.cos(frame[..., 2]), np.sin(frame[..., 2])
    return np.stack((c * offset[..., 0] + s * offset[..., 1], c * offset[..., 1] - s * offset[..., 0]), axis=-1)


def arc(twist: Array, dt: float) -> Array:
    """Pose after driving ``dt`` s at a constant twist, seen from where it began: exactly an arc.

    Parameters
    ----------
    twist
        Forward speed and turn rate, ``(..., 2)``, m/s and rad/s.
    dt
        s.

    Returns
    -------
    numpy.ndarray
        ``(..., 3)``.
    """
    turned = twist[..., 1] * dt
    half = turned / 2
    chord = twist[..., 0] * dt * np.sinc(half / np.pi)
    return np.stack((chord * np.cos(half), chord * np.sin(half), turned), axis=-1)


def wrap(angle: Array) -> Array:
    """Angles in [-π, π)."""
    out: Array = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return out
