"""Which points that a robot sees are its team mates, and no obstacles.

A robot knows where the others are to be. Points there are most likely them: they stop it like any other point, but a
robot that they pushed aside would leave its place.
"""

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array


def is_obstacle(points: Array, robot: NDArray[np.intp], begin: Array, end: Array, reach: Array) -> NDArray[np.bool_]:
    """Return which points are farther than a reach from where team mates are to be, or were to be a moment ago.

    Parameters
    ----------
    points
        ``(k, 2)``, m.
    robot
        ``(k,)``: which of m robots sees them.
    begin, end
        ``(m, c, 2)``: where c team mates of each robot were to be, and are to be; in the same frame as the robot's
        points, m. Between the two they have driven straight on. Not a number for one that is nowhere.
    reach
        m from there up to which a point is the team mate, ``(m, c)``; below zero for one that is not looked for.

    Returns
    -------
    numpy.ndarray
        ``(k,)``.
    """
    out = np.ones(len(points), dtype=bool)
    for start, way, radius in zip(*(np.moveaxis(x, 1, 0)[:, robot] for x in (begin, end - begin, reach)), strict=True):
        length = (way**2).sum(axis=-1)
        share = ((points - start) * way).sum(axis=-1) / np.where(length > 0, length, 1.0)
        distance = np.hypot(*(points - start - np.clip(share, 0, 1)[:, None] * way).T)
        out &= ~(distance < radius)
    return out
