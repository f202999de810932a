"""The world robots drive in: walls and obstacles, seen from above."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array, positive
from mp2a.dependencies import need
from mp2a.exceptions import InputError
from mp2a.se2 import act
from mp2a.spatial import Array

FARTHEST = 1e5
"""m: coordinates beyond it are taken for a mistake."""


@dataclass(frozen=True, eq=False)
class World:
    """Walls and obstacles in the ground frame, m.

    Attributes
    ----------
    walls
        Arrays ``(k, 2)`` of the corners of open lines; robots may stand on either side.
    obstacles
        Arrays ``(k, 2)`` of the corners of solid outlines, whose last corner is joined to the first.
    name
        What a picture calls it.

    Raises
    ------
    InputError
        If a line has fewer than two corners or an outline fewer than three, two neighbouring corners are one place,
        or an outline crosses itself.
    """

    walls: Sequence[Array] = ()
    obstacles: Sequence[Array] = ()
    name: str = ""

    def __post_init__(self) -> None:
        walls = tuple(_corners(f"walls[{i}]", line, closed=False) for i, line in enumerate(self.walls))
        obstacles = tuple(_corners(f"obstacles[{i}]", line, closed=True) for i, line in enumerate(self.obstacles))
        object.__setattr__(self, "walls", walls)
        object.__setattr__(self, "obstacles", obstacles)

    @cached_property
    def lines(self) -> tuple[Array, ...]:
        """All outlines as lines ``(k, 2)``: walls, then obstacles, which end where they began."""
        return (*self.walls, *(np.concatenate((outline, outline[:1])) for outline in self.obstacles))

    @cached_property
    def segments(self) -> Array:
        """``(m, 2, 2)`` ends of all straight pieces."""
        pieces = [np.stack((line[:-1], line[1:]), axis=1) for line in self.lines]
        return np.concatenate([np.empty((0, 2, 2)), *pieces])

    @cached_property
    def shapes(self) -> Any:
        """All walls as shapely lines and all obstacles as shapely polygons, an array of them."""
        shapely = geometry()
        shapes = [shapely.LineString(line) for line in self.walls]
        shapes += [shapely.Polygon(line) for line in self.obstacles]
        return np.array(shapes, dtype=object)


def geometry() -> Any:
    """Import shapely, when it is needed: ranks that are a robot alone have no geometry.

    Raises
    ------
    DependencyError
        If it is not installed.
    """
    return need("shapely", extra="formation", purpose="the simulator")


def box(centre: ArrayLike, size: ArrayLike, heading: float = 0.0) -> Array:
    """Corners of a rectangle.

    Parameters
    ----------
    centre
        ``(2,)`` m.
    size
        ``(2,)`` m, along its own x and y axis.
    heading
        Of its x axis, rad.

    Returns
    -------
    ndarray
        ``(4, 2)`` m, counter-clockwise.
    """
    return rectangles(np.array([[*np.asarray(centre), heading]]), *np.atleast_2d(size).T)[0]


def disc(centre: ArrayLike, radius: float, sides: int = 32) -> Array:
    """Corners of a regular polygon around a circle, which it touches from outside.

    Parameters
    ----------
    centre
        ``(2,)`` m.
    radius
        Of the circle, m.
    sides
        How many.

    Returns
    -------
    ndarray
        ``(sides, 2)`` m, counter-clockwise.

    Raises
    ------
    InputError
        If the radius is not positive and finite.
    """
    positive("radius", radius)
    angles = 2 * np.pi * np.arange(sides) / sides
    reach = radius / np.cos(np.pi / sides)
    out: Array = np.asarray(centre) + reach * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    return out


def rectangles(poses: Array, lengths: Array, widths: Array) -> Array:
    """Corners of rectangles around their poses.

    Parameters
    ----------
    poses
        ``(n, 3)`` m, m, rad: centre and direction of the length.
    lengths, widths
        ``(n,)`` m.

    Returns
    -------
    ndarray
        ``(n, 4, 2)`` m, counter-clockwise from the front left corner.
    """
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return act(poses[:, None], signs * np.stack((lengths, widths), axis=-1)[:, None] / 2)


def _corners(name: str, given: ArrayLike, closed: bool) -> Array:
    points = array(name, given, (None, 2))
    least = 3 if closed else 2
    if len(points) < least:
        raise InputError(f"{name}: got {len(points)} points, expected at least {least}")
    if (far := np.abs(points) > FARTHEST).any():
        raise InputError(f"{name}: got {points[far][0]:g} m, expected coordinates of at most {FARTHEST:g} m")
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    same = np.flatnonzero((points[: len(ends)] == ends).all(axis=1))
    if len(same):
        at = points[same[0]].tolist()
        raise InputError(f"{name}: got {at} twice in a row, expected neighbouring points in different places")
    if closed and not geometry().Polygon(points).is_valid:
        raise InputError(f"{name}: got an outline that crosses or touches itself, expected a simple one")
    return points
