"""What LIDAR points do to a robot: the virtual force field and the stop signals (thesis, section 5.2).

The thesis sums a small repulsive force over points and prints no law for it. Ours is that of Borenstein and Koren,
whose method it is (Real-time obstacle avoidance for fast mobile robots, 1989): points are sorted into square cells, and
every occupied cell pushes with 1/d², weighted with how straight ahead or behind it is, cos⁴. So the number of rays does
not matter, and a robot that drives alongside hardly does.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import numbers
from mp2a.exceptions import InputError
from mp2a.formation.choreography.constants import (
    CELL,
    CELL_FORCE,
    HIGHEST,
    LOWEST,
    STOP_DISTANCE,
    STOP_SIDE,
    TURN_AHEAD,
    TURN_SIDE,
    WINDOW,
)
from mp2a.spatial import Array

_SIDE = round(WINDOW / CELL)
_TURNS = 5
"""Steps in which a turn is looked ahead; between two a HUSKY's corner moves by 6 cm."""


class Seen(NamedTuple):
    """What the points of a tick say.

    Attributes
    ----------
    force
        F, ``(n, 2)`` in the robots' frames.
    front, rear
        ``(n,)``: stop_front and stop_rear.
    left, right
        ``(n,)``: a turn that way would bring the body against a point. The thesis has no such signal; without one, a
        robot that stands close to a wall touches it with a corner as it turns.
    """

    force: Array
    front: NDArray[np.bool_]
    rear: NDArray[np.bool_]
    left: NDArray[np.bool_]
    right: NDArray[np.bool_]


def from_cloud(cloud: ArrayLike) -> Array:
    """Points ``(k, 2)`` of a 3-D cloud ``(k, 3)`` in the robot's frame that are in the way: neither floor nor ceiling.

    Raises
    ------
    InputError
        If the cloud is not ``(k, 3)``.
    """
    points = numbers("cloud", cloud)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"cloud: got shape {points.shape}, expected (k, 3)")
    height = points[:, 2]
    return points[(height > LOWEST) & (height < HIGHEST), :2]


def flatten(points: Sequence[ArrayLike | None], n: int) -> tuple[Array, NDArray[np.intp]]:
    """Points of all robots in one array ``(k, 2)``, and whose each is ``(k,)``.

    Raises
    ------
    InputError
        If there is not one entry a robot, or one is not ``(k, 2)``.
    """
    if len(points) != n:
        raise InputError(f"points: got {len(points)} entries, expected {n}, one a robot (None: no new data)")
    clouds = []
    for i, cloud in enumerate(points):
        given = np.empty((0, 2)) if cloud is None else numbers(f"points[{i}]", cloud)
        given = given.reshape(-1, 2) if given.size == 0 else given
        if given.ndim != 2 or given.shape[1] != 2:
            raise InputError(f"points[{i}]: got shape {given.shape}, expected (k, 2)")
        clouds.append(given)
    whose = np.repeat(np.arange(n), [len(cloud) for cloud in clouds])
    return np.concatenate(clouds) if clouds else np.empty((0, 2)), whose


def look(
    points: Array, whose: NDArray[np.intp], lengths: Array, widths: Array, pushing: NDArray[np.bool_] | None = None
) -> Seen:
    """Work out force and stop signals.

    Parameters
    ----------
    points
        ``(k, 2)`` in the frame of the robot that sees them, m; what is not finite is not there.
    whose
        ``(k,)``: index of that robot.
    lengths, widths
        ``(n,)`` of the robots, m.
    pushing
        ``(k,)``: which points push; None: all do. All stop robots.

    Returns
    -------
    Seen
        Force and signals of every robot.
    """
    n = len(lengths)
    with np.errstate(invalid="ignore"):
        inside = (np.abs(points) < WINDOW / 2).all(axis=1)
    near, robot = points[inside], whose[inside]
    cell = np.floor((near + WINDOW / 2) / CELL).astype(np.intp).clip(0, _SIDE - 1)
    occupied = np.zeros((n, _SIDE * _SIDE))
    occupied[robot, cell[:, 0] * _SIDE + cell[:, 1]] = 1.0 if pushing is None else pushing[inside]
    half = lengths[robot] / 2
    lane = np.abs(near[:, 1]) < widths[robot] / 2 + STOP_SIDE
    ahead = lane & (near[:, 0] > 0) & (near[:, 0] < half + STOP_DISTANCE)
    behind = lane & (near[:, 0] < 0) & (near[:, 0] > -half - STOP_DISTANCE)
    sides = (_swept(near, half, widths[robot] / 2, side) for side in (1.0, -1.0))
    signals = (np.bincount(robot[which], minlength=n) > 0 for which in (ahead, behind, *sides))
    return Seen(occupied @ _field(), *signals)


def _swept(points: Array, half_length: Array, half_width: Array, side: float) -> NDArray[np.bool_]:
    """Which points a body meets if it turns, ``side`` 1 to the left and -1 to the right, ``(k,)``.

    Points that are within TURN_SIDE of the body from the start are met if the turn brings them nearer.
    """
    size = np.stack((half_length, half_width), axis=-1)
    met = np.zeros(len(points), dtype=bool)
    for angle in side * TURN_AHEAD * np.arange(1, _TURNS + 1) / _TURNS:
        c, s = np.cos(angle), np.sin(angle)
        turned = points @ np.array([[c, -s], [s, c]])
        met |= (np.abs(turned) < size + TURN_SIDE).all(axis=-1)
    body = np.clip(points, -size, size)  # what of it is nearest to each point, and goes to its left or right
    towards = side * (body[:, 0] * (points - body)[:, 1] - body[:, 1] * (points - body)[:, 0])
    close = (np.abs(points) < size + TURN_SIDE).all(axis=-1)
    out: NDArray[np.bool_] = np.where(close, towards > 0, met)
    return out


@cache
def _field() -> Array:
    """Force of every cell of the window if it is occupied, ``(cells, 2)``."""
    middle = (np.arange(_SIDE) + 0.5) * CELL - WINDOW / 2
    x, y = np.meshgrid(middle, middle, indexing="ij")
    distance = np.hypot(x, y)
    size = CELL_FORCE / distance**2 * (x / distance) ** 4
    out: Array = np.stack((-size * x / distance, -size * y / distance), axis=-1).reshape(-1, 2)
    return out
