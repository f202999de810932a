r"""The force of an obstacle on a robot (paper, eq. 14; eq. 13 of the other printing).

.. math:: F_{RA} = Rot(φ) \begin{bmatrix} C_N & 0 \\ 0 & -C_N + C_T \end{bmatrix} Rot(φ)^T
          \begin{bmatrix} k_R \\ k_A Δ_{max}^2 \end{bmatrix}

The paper says of the symbols: C_T and C_N are the tangential and normal forces used to generate repulsion and
attraction; Δ_max is the orthogonal distance from the robot to the straight line that holds the segment; k_R and k_A
tune repulsion, which drives the robot away, and attraction, which recovers the original trajectory. It does not say
from which line φ is measured, in which frame the vector stands, or how C_N and C_T depend on the obstacle. They are
read here as follows.

- The *segment* is the piece of path the robot is on: where it would be were there no obstacle. Δ_max, m, is how far to
  the side of it the robot is. Obstacles are seen from it: how far along, how far to the side. In a line the path bends
  as the robots ahead have made way, and whoever follows a path that is clear feels nothing.
- The vector stands in the frame of the obstacle's ray: axis 1 points from the obstacle's nearest point to the robot
  (repulsion, k_R, a number), axis 2 at a right angle to it towards the path (attraction, k_A, 1/m²).
- φ is the angle from that ray to the path's normal. So the matrix weighs the part of the vector across the path by C_N,
  and the part along it by C_T - C_N: with C_T = C_N a robot makes way to the side and keeps its speed, with
  C_T > C_N it is held back as well.
- C_N = force · (1 - ρ)² in N, and none from ρ = 1 on; C_T = tangential · C_N. ρ is the distance of the point in units
  of the reach, which is an ellipse: ``ahead`` along the path, ``beside`` across it, ``radius`` behind.
- An obstacle closer to straight ahead than ``swerve`` is taken to lie at that angle, or the force would have no part to
  the side; one exactly ahead counts as on the right. The law acts once for the right and once for the left, on the
  point that has the largest C_N there. All points of an obstacle that lies across the path count as on the side that
  has more of it: pushed from both its halves, a robot would go neither way.

Limits: the law sees the nearest point, not a shape; a cul-de-sac or a wall across the path holds nobody up, since the
path goes on and the springs pull. The force is finite, and so is what it can hold off: force · k_R / stiffness is the
largest swerve. ``beside`` has to be less than the distance of robots side by side, or they push each other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.formation.vectors import Complex
from mp2a.spatial import Array

_TIE = 1e-6
"""m; a point that is less than this to the left counts as on the right, so that rounding does not choose a side."""


@dataclass(frozen=True)
class ObstacleLaw:
    """Constants of eq. 14.

    Attributes
    ----------
    force
        C_N of a point in the robot's middle, N.
    tangential
        C_T / C_N.
    repulsion
        k_R.
    attraction
        k_A, 1/m².
    ahead, beside
        Reach along and across the path, from the robot's middle, m.
    radius
        Of the robot, m: reach behind; a point closer than this is inside it.
    swerve
        Least angle between the path and the ray to an obstacle, rad.

    Raises
    ------
    InputError
        If one is negative or not finite, or a reach is zero.
    """

    force: float = 1200.0
    tangential: float = 1.0
    repulsion: float = 1.0
    attraction: float = 0.1
    ahead: float = 4.0
    beside: float = 1.4
    radius: float = 0.6
    swerve: float = np.pi / 4

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            least = value > 0 if name in ("ahead", "beside", "radius") else value >= 0
            if not least or not value < np.inf:
                raise InputError(f"{name}: got {value!r}, expected a number above zero")


def push(law: ObstacleLaw, points: Complex, robot: NDArray[np.intp], aside: Array) -> Complex:
    """Return the force on each robot of what it senses.

    Parameters
    ----------
    law
        Constants.
    points
        From the robot to the obstacle along the path and across it, x + i y, ``(k,)``, m.
    robot
        Which of the m robots sensed it, ``(k,)``.
    aside
        How far the robots are to the left of their paths, ``(m,)``, m.

    Returns
    -------
    numpy.ndarray
        x + i y of the force in the path's axes, ``(m,)``, N. A point in a robot's very middle pushes it to the left.
    """
    total = np.zeros(len(aside), dtype=complex)
    level = np.maximum(0.0, 1 - _reach(law, points)) ** 2
    left = _sides(law, points, robot, level)
    side = 2 * robot + left
    most = np.zeros(2 * len(aside))
    np.maximum.at(most, side, level)
    best = np.flatnonzero((level == most[side]) & (level > 0))
    chosen = np.full(2 * len(aside), -1)
    chosen[side[best]] = best
    chosen = chosen[chosen >= 0]
    ray = _ray(law, points[chosen], left[chosen])
    np.add.at(total, robot[chosen], eq14(law, level[chosen], ray, aside[robot[chosen]]))
    return total


def _sides(law: ObstacleLaw, points: Complex, robot: NDArray[np.intp], level: Array) -> NDArray[np.bool_]:
    """Return which points count as on the left.

    Those of an obstacle across the path all count as on the side that has more of it. Points in the order in which a
    robot sees them are one obstacle until there is a gap that the robot fits through.
    """
    left: NDArray[np.bool_] = points.imag > _TIE
    near = np.flatnonzero(level > 0)
    if not len(near):
        return left
    order = near[np.lexsort((np.angle(points[near]), robot[near]))]
    across = points[order].imag
    first = np.abs(np.diff(points[order])) > 2 * law.radius
    first = np.concatenate(([True], first | (np.diff(robot[order]) != 0)))
    starts, which = np.flatnonzero(first), np.cumsum(first) - 1
    low, high = np.minimum.reduceat(across, starts), np.maximum.reduceat(across, starts)
    left[order] = np.where(low < -_TIE, low + high > 2 * _TIE, high > _TIE)[which]
    return left


def eq14(law: ObstacleLaw, level: Array, ray: Complex, aside: Array) -> Complex:
    """Return eq. 14 as printed, in the path's axes.

    Parameters
    ----------
    law
        Constants.
    level
        C_N as a part of ``law.force``, ``(k,)``.
    ray
        Unit vectors from obstacle to robot in the path's axes (x along it), ``(k,)``.
    aside
        Δ_max with a sign, positive to the left of the path, ``(k,)``, m.

    Returns
    -------
    numpy.ndarray
        x + i y of the forces, ``(k,)``, N.
    """
    normal = law.force * level
    tangential = law.tangential * normal
    # Axis 2 is the ray turned a quarter to the left, or its opposite: the one that leads back to the path.
    towards = -np.sign(aside * ray.real)
    repulsion, attraction = law.repulsion, law.attraction * aside**2 * towards
    phi = np.pi / 2 - np.angle(ray)
    c, s = np.cos(phi), np.sin(phi)
    across, along = normal * (c * repulsion + s * attraction), (tangential - normal) * (c * attraction - s * repulsion)
    out: Complex = ((c * across - s * along) + 1j * (s * across + c * along)) * ray
    return out


def _reach(law: ObstacleLaw, points: Complex) -> Array:
    along = np.where(points.real > 0, law.ahead, law.radius)
    out: Array = np.hypot(points.real / along, points.imag / law.beside)
    return out


def _ray(law: ObstacleLaw, points: Complex, left: NDArray[np.bool_]) -> Complex:
    """Point from obstacles to the robot, at least ``swerve`` off the path, to the side where the obstacle is not."""
    distance = np.abs(points)
    away = np.where(distance > 0, -points / np.where(distance > 0, distance, 1.0), 1j)
    least = np.sin(law.swerve)
    lifted = np.where(away.real > 0, 1.0, -1.0) * np.cos(law.swerve) + 1j * np.where(left, -1.0, 1.0) * least
    out: Complex = np.where(np.where(left, -away.imag, away.imag) < least, lifted, away)
    return out
