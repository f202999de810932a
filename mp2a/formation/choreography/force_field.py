"""The virtual force field of what a robot sees (thesis, section 5.2), and the turn away from it (eq. 4.4b).

The thesis sums a small repulsive force over points and prints no law for it. Ours is that of Borenstein and Koren,
whose method it is (Real-time obstacle avoidance for fast mobile robots, 1989): points are sorted into square cells, and
every occupied cell pushes with 1/d², weighted with how straight ahead or behind it is, cos⁴. So the number of rays does
not matter, and a robot that drives alongside hardly does.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.constants import CELL, CELL_FORCE, FORCE_GAIN, STOP_SIDE, WINDOW
from mp2a.spatial import Array

_SIDE = round(WINDOW / CELL)
_ROUNDING = 1e-9
"""Cells: walls often stand on the edge of one, and which one they are in is not a matter of rounding."""


def forces(points: Array, robot: NDArray[np.intp], widths: Array) -> Array:
    """Work out what pushes n robots.

    Parameters
    ----------
    points
        ``(k, 2)`` in the frame of the robot that sees them, m; what is not finite is not there.
    robot
        ``(k,)``: which robot.
    widths
        ``(n,)`` of the robots, m.

    Returns
    -------
    numpy.ndarray
        ``(n, 2, 2)``: the forces, in the robots' frames, of what is on the left and of what is on the right if the lane
        ahead between both is free; else that of all, and zero. F of the thesis is the sum of both.
    """
    with np.errstate(invalid="ignore"):
        inside = (np.abs(points) < WINDOW / 2).all(axis=1)
    points, robot, n = points[inside], robot[inside], len(widths)
    cell = np.floor((points + WINDOW / 2) / CELL + _ROUNDING).astype(np.intp).clip(0, _SIDE - 1)
    occupied = np.zeros((n, _SIDE, _SIDE))
    occupied[robot, cell[:, 0], cell[:, 1]] = 1.0
    halves = zip(np.split(occupied, 2, axis=2), np.split(_field(), 2, axis=1), strict=True)
    right, left = (np.tensordot(half, field, 2) for half, field in halves)
    ahead = (points[:, 0] > 0) & (np.abs(points[:, 1]) < widths[robot] / 2 + STOP_SIDE)
    one = np.bincount(robot[ahead], minlength=n)[:, None] > 0
    return np.stack((np.where(one, left + right, left), np.where(one, 0.0, right)), axis=1)


def avoidance(force: Array) -> Array:
    """Return the turn rate away from obstacles: the second term of eq. 4.4b, ``(n, 2, 2)`` to ``(n,)`` rad/s.

    The end of the robot that is nearer to them swings away: α₂ is the angle of the force, with its sign. Where the
    print has sgn(Fx) this has cos α₂, so that -2 sgn(Fx) α₂ |F| becomes -2 Fx α₂: the same ahead and behind, and
    without a jump where an obstacle is abeam, across which a robot beside another would swing for ever.

    Where a robot drives between two obstacles the law acts for each of them. For the sum of both α₂ would be ±π, its
    sign that of whichever is nearer by a millimetre, and the robot would turn to and fro at full rate.
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
