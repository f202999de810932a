"""The virtual force field of what a robot sees (thesis, section 5.2), and the turn away from it (eq. 4.4b).

The thesis sums a small repulsive force over points and prints no law for it. Ours is that of Borenstein and Koren,
whose method it is (Real-time obstacle avoidance for fast mobile robots, 1989): points are sorted into square cells, and
every occupied cell pushes with 1/d², weighted with how straight ahead or behind it is, cos⁴. So the number of rays does
not matter, and a robot that drives alongside hardly does.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.constants import CELL, CELL_FORCE, FORCE_GAIN, WINDOW
from mp2a.spatial import Array

_SIDE = round(WINDOW / CELL)


def forces(points: Array, robot: NDArray[np.intp], n: int) -> Array:
    """Work out what pushes n robots.

    Parameters
    ----------
    points
        ``(k, 2)`` in the frame of the robot that sees them, m; what is not finite is not there.
    robot
        ``(k,)``: which robot.
    n
        How many robots.

    Returns
    -------
    numpy.ndarray
        ``(n, 2, 2)``: for what is on the left and what is on the right the force in the robots' frames. F of the thesis
        is the sum of both.
    """
    with np.errstate(invalid="ignore"):
        inside = (np.abs(points) < WINDOW / 2).all(axis=1)
    cell = np.floor((points[inside] + WINDOW / 2) / CELL).astype(np.intp).clip(0, _SIDE - 1)
    occupied = np.zeros((n, _SIDE, _SIDE))
    occupied[robot[inside], cell[:, 0], cell[:, 1]] = 1.0
    right, left = np.split(occupied, 2, axis=2)
    field_right, field_left = np.split(_field(), 2, axis=1)
    sides = (np.tensordot(part, field, 2) for part, field in ((left, field_left), (right, field_right)))
    return np.stack(tuple(sides), axis=1)


def avoidance(force: Array) -> Array:
    """Return the turn rate away from obstacles: the second term of eq. 4.4b, ``(n, 2, 2)`` to ``(n,)`` rad/s.

    The end of the robot that is nearer to them swings away: α₂ is the angle of the force, with its sign. Where the
    print has sgn(Fx) this has cos α₂, so that -2 sgn(Fx) α₂ |F| becomes -2 Fx α₂: the same ahead and behind, and
    without a jump where an obstacle is abeam, across which a robot beside another would swing for ever.

    The law acts once for what is on the left and once for what is on the right. For both together α₂ would be ±π
    between two walls, its sign that of whichever happens to be nearer by a millimetre, and the robot would turn to and
    fro at full rate.
    """
    out: Array = -FORCE_GAIN * (force[..., 0] * np.arctan2(force[..., 1], force[..., 0])).sum(axis=-1)
    return out


@cache
def _field() -> Array:
    """Return the force of every cell of the window if it is occupied, ``(cells, cells, 2)``."""
    middle = (np.arange(_SIDE) + 0.5) * CELL - WINDOW / 2
    x, y = np.meshgrid(middle, middle, indexing="ij")
    distance = np.hypot(x, y)
    size = CELL_FORCE / distance**2 * (x / distance) ** 4
    return np.stack((-size * x / distance, -size * y / distance), axis=-1)
