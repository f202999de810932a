"""What robots sense: points of obstacles, each robot's in its own frame, packed so that no step goes robot by robot."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array, numbers
from mp2a.exceptions import InputError
from mp2a.se2 import rotate
from mp2a.spatial import Array


class SensedPoints(NamedTuple):
    """What the sensors of the m robots of this process have said since the last tick."""

    points: Array
    """``(k, 2)``: x ahead, y to the left, m, each in the frame of the robot that sensed it"""
    robot: NDArray[np.intp]
    """``(k,)``: which of the m robots"""
    heard: NDArray[np.bool_]
    """``(m,)``: whether the sensor said anything; no points from one that did means that nothing is near"""


def pack(points: Sequence[ArrayLike | None], robots: int | None = None, *, finite: bool = True) -> SensedPoints:
    """Pack one array ``(k, 2)`` a robot; None for a sensor that has said nothing.

    Parameters
    ----------
    points
        m, each in the frame of the robot that sensed it.
    robots
        How many there have to be; None: any number.
    finite
        Whether other numbers are refused; a LIDAR may have some where it sees nothing.

    Raises
    ------
    InputError
        If one of them is not ``(k, 2)`` numbers, or there is not one entry a robot.
    """
    if robots is not None and len(points) != robots:
        raise InputError(f"points: got {len(points)} entries, expected {robots}, one a robot (None: no new data)")
    clouds = []
    for i, cloud in enumerate(points):
        rows = np.empty((0, 2)) if cloud is None else numbers(f"points[{i}]", cloud)
        rows = rows.reshape(-1, 2) if rows.size == 0 else rows
        clouds.append(array(f"points[{i}]", rows, (None, 2), finite=finite))
    owners = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
    heard = np.array([cloud is not None for cloud in points], dtype=bool)
    return SensedPoints(np.concatenate(clouds) if clouds else np.empty((0, 2)), owners, heard)


def check_points(sensed: SensedPoints, robots: int) -> SensedPoints:
    """Check packed points for a number of robots.

    Raises
    ------
    InputError
        Naming the part, what was given and what was expected.
    """
    points = array("points", sensed.points, (None, 2))
    owners = array("robot", sensed.robot, (len(points),), whole=True)
    if len(owners) and not 0 <= owners.min() <= owners.max() < robots:
        raise InputError(f"robot: got {owners.min()} to {owners.max()}, expected numbers from 0 to {robots - 1}")
    heard = array("heard", sensed.heard, (robots,)).astype(bool)
    return SensedPoints(points, owners, heard)


def nothing(robots: int) -> SensedPoints:
    """Return what sensors say that see nothing."""
    return SensedPoints(np.empty((0, 2)), np.empty(0, dtype=np.intp), np.ones(robots, dtype=bool))


def is_obstacle(points: Array, robot: NDArray[np.intp], begin: Array, end: Array, reach: Array) -> NDArray[np.bool_]:
    """Return which points are farther than a reach from where team mates are to be, or were to be a moment ago.

    A robot knows where the others are to be. Points there are most likely them: they stop it like any other point, but
    a robot that they pushed aside would leave its place.

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


_INSIDE = 1e-3
"""m"""


class Discs:
    """A small world for tests and examples: discs on the ground, of which robots see the nearest point each.

    Parameters
    ----------
    discs
        ``(k, 3)``: x, y and radius, m.
    reach
        How far robots see, m.

    Raises
    ------
    InputError
        If a radius is negative or a number not finite.
    """

    def __init__(self, discs: ArrayLike = (), reach: float = 5.0) -> None:
        rows = np.asarray(discs)
        self.discs = array("discs", np.empty((0, 3)) if rows.size == 0 else rows, (None, 3))
        if (self.discs[:, 2] < 0).any():
            raise InputError(f"discs: got a radius of {self.discs[:, 2].min()}, expected none below zero")
        self.reach = reach

    def sense(self, poses: Array) -> SensedPoints:
        """Return the nearest points of the discs in reach of robots at ``(m, 3)`` poses."""
        ahead = self.discs[:, :2] - poses[:, None, :2]
        distance = np.hypot(*np.moveaxis(ahead, -1, 0))
        robot, disc = np.nonzero(distance - self.discs[:, 2] < self.reach)
        far = distance[robot, disc][:, None]
        # Within a disc its edge would push a robot to the middle; it feels what is next to it on the middle's side.
        towards = np.where(far > 0, ahead[robot, disc] / np.where(far > 0, far, 1.0), (1.0, 0.0))
        points = rotate(-poses[robot, 2], towards * np.maximum(far - self.discs[disc, 2:], _INSIDE))
        return SensedPoints(points, robot, np.ones(len(poses), dtype=bool))

    def clearance(self, poses: Array) -> Array:
        """Return the distance of ``(..., 3)`` poses from the nearest disc's edge, ``(...,)``, m; inside it negative."""
        distance = np.hypot(*np.moveaxis(self.discs[:, :2] - poses[..., None, :2], -1, 0))
        out: Array = np.min(distance - self.discs[:, 2], axis=-1, initial=np.inf)
        return out
