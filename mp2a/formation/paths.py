r"""What the leader alone knows: a path, and when it is where on it.

A `Path` is a curve by arc length and a speed profile. Curves are made of lines and arcs, of waypoints joined by lines
whose corners are rounded by arcs, or of a cubic spline. A rounded corner is what a robot that cannot turn on the spot
can drive (thesis, 4.1), so there are no stop-and-turn corners. Where a line meets an arc the turn rate jumps, as on any
path of lines and arcs; a spline has none of these jumps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array
from mp2a.exceptions import InputError
from mp2a.formation.speed import Limits, SpeedProfile, profile
from mp2a.formation.vectors import Complex, as_complex
from mp2a.se2 import PlanarMotion, compose, exp
from mp2a.spatial import Array

_KNOT = 0.05
"""Distance between knots of the speed profile, m."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


class PathPoint(NamedTuple):
    """A curve at an arc length."""

    position: complex
    """x + i y, m"""
    heading: float
    """rad"""
    curvature: float
    """1/m"""
    bending: float
    """Derivative of the curvature by arc length, 1/m²"""


@dataclass(frozen=True)
class Path:
    """A curve and when to be where on it, from rest to rest.

    Attributes
    ----------
    curve
        From arc length in m to a point of the path.
    profile
        Speeds.
    """

    curve: Callable[[float], PathPoint]
    profile: SpeedProfile

    @property
    def length(self) -> float:
        """Of the whole path, m."""
        return float(self.profile.arc[-1])

    @property
    def duration(self) -> float:
        """From start to end, s."""
        return float(self.profile.time[-1])

    def at(self, time: float) -> PlanarMotion:
        """Return the motion ``(3,)`` at a time in s; before the start and after the end at rest."""
        arc, speed, acceleration = self.profile.at(time)
        place = self.curve(arc)
        turning = place.bending * speed**2 + place.curvature * acceleration
        return PlanarMotion(
            np.array([place.position.real, place.position.imag, place.heading]),
            np.array([speed, 0.0, place.curvature * speed]),
            np.array([acceleration, 0.0, turning]),
        )


class Line(NamedTuple):
    """Straight on."""

    length: float
    """m"""
    curvature: float = 0.0


class Arc(NamedTuple):
    """Along a circle."""

    radius: float
    """m, positive"""
    angle: float
    """rad, positive to the left"""

    @property
    def length(self) -> float:
        """Of the arc, m."""
        return self.radius * abs(self.angle)

    @property
    def curvature(self) -> float:
        """1/m, positive to the left."""
        return float(np.sign(self.angle)) / self.radius


def lines_and_arcs(pieces: Sequence[Line | Arc], start: ArrayLike = (0, 0, 0), limits: Limits | None = None) -> Path:
    """Path of lines and arcs, each going on in the direction in which the last one ended.

    Parameters
    ----------
    pieces
        At least one `Line` or `Arc`.
    start
        Pose, m, m, rad.
    limits
        Default: `Limits()`.

    Raises
    ------
    InputError
        If there is no piece, or a length or radius is not positive and finite.
    """
    x, y, heading = array("start", start, (3,))
    if not pieces:
        raise InputError("pieces: got none, expected at least one line or arc")
    for i, piece in enumerate(pieces):
        if not 0 < piece.length < np.inf or (isinstance(piece, Arc) and not piece.radius > 0):
            raise InputError(f"pieces: got {piece} as piece {i}, expected a positive length and radius")
    starts = [(0.0, complex(x, y), float(heading))]
    for piece in pieces:
        arc, position, heading = starts[-1]
        ahead = _along(piece, piece.length, position, heading)
        starts.append((arc + piece.length, ahead.position, ahead.heading))
    ends = np.array([arc for arc, _, _ in starts])

    def curve(arc: float) -> PathPoint:
        i = min(int(np.searchsorted(ends, arc, side="right")) - 1, len(pieces) - 1)
        before, position, heading = starts[i]
        return _along(pieces[i], arc - before, position, heading)

    knots, bends = [np.zeros(1)], []
    for (arc, _, _), piece in zip(starts, pieces, strict=False):
        inner = np.linspace(0, piece.length, 2 + int(piece.length / _KNOT))[1:]
        knots.append(arc + inner)
        bends.append(np.full(len(inner), abs(piece.curvature)))
    return Path(curve, profile(np.concatenate(knots), np.concatenate(bends), limits or Limits()))


def waypoints(points: ArrayLike, radius: float = 1.0, limits: Limits | None = None) -> Path:
    """Path along straight lines between points, with corners rounded by arcs that touch both lines.

    Parameters
    ----------
    points
        ``(k, 2)``, k ≥ 2, m.
    radius
        Of the arcs, m; smaller where a line is too short for it, but never larger.
    limits
        Default: `Limits()`.

    Raises
    ------
    InputError
        If there are fewer than two points, two in sequence are the same, or the path turns right back.
    """
    corners = _points(points)
    if not 0 < radius < np.inf:
        raise InputError(f"radius: got {radius!r}, expected a positive number")
    ways = np.diff(corners)
    lengths, headings = np.abs(ways), np.angle(ways)
    turns = np.angle(ways[1:] / ways[:-1])
    if (np.abs(turns) > np.pi - 1e-6).any():
        i = int(np.argmax(np.abs(turns)))
        raise InputError(f"points: got a path that turns right back at point {i + 1}, expected a corner to drive round")
    tangents = np.tan(np.abs(turns) / 2)
    # An arc takes radius · tan(turn / 2) of the lines before and after it; neighbours share a line between them.
    room = np.minimum(lengths[:-1] / _sharers(len(turns), first=True), lengths[1:] / _sharers(len(turns), first=False))
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = np.where(tangents > 0, np.minimum(radius, room / tangents), radius)
    cuts = np.concatenate(([0.0], radii * tangents, [0.0]))
    pieces: list[Line | Arc] = []
    for i, length in enumerate(lengths):
        straight = float(length - cuts[i] - cuts[i + 1])
        if straight > 1e-9 * length:
            pieces.append(Line(straight))
        if i < len(turns) and turns[i] != 0:
            pieces.append(Arc(float(radii[i]), float(turns[i])))
    start = (corners[0].real, corners[0].imag, headings[0])
    return lines_and_arcs(pieces, start, limits)


def spline(points: ArrayLike, limits: Limits | None = None) -> Path:
    """Smooth path through points: a natural cubic spline over the distance between them, by arc length.

    Parameters
    ----------
    points
        ``(k, 2)``, k ≥ 2, m.
    limits
        Default: `Limits()`.

    Raises
    ------
    InputError
        If there are fewer than two points, or two in sequence are the same.
    """
    through = _points(points)
    knots = np.append(0.0, np.cumsum(np.abs(np.diff(through))))
    bends = _natural(knots, through)

    def derivatives(at: Array) -> tuple[Array, Array, Array, Array]:
        i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
        h, u = knots[i + 1] - knots[i], at - knots[i]
        third = (bends[i + 1] - bends[i]) / h
        slope = (through[i + 1] - through[i]) / h - h * (2 * bends[i] + bends[i + 1]) / 6
        value = through[i] + u * (slope + u * (bends[i] / 2 + u * third / 6))
        return value, slope + u * (bends[i] + u * third / 2), bends[i] + u * third, third

    count = 2 + int(knots[-1] / _KNOT)
    grid = np.unique(np.concatenate((np.linspace(0, knots[-1], count), knots)))
    arc = np.append(0.0, np.cumsum(_lengths(grid, derivatives)))

    def curve(length: float) -> PathPoint:
        at = np.array(np.interp(length, arc, grid))
        for _ in range(3):  # Newton: the interpolated parameter's arc length against the one wanted
            i = int(np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2))
            have = arc[i] + _lengths(np.array([grid[i], float(at)]), derivatives)[0]
            at = at + (length - have) / np.abs(derivatives(at)[1])
        value, first, second, third = (complex(part) for part in derivatives(at))
        scale, ratio = abs(first), second / first
        # By arc length: d(heading)/ds = Im(z''/z')/|z'| and once more.
        curvature = ratio.imag / scale
        bending = (third / first - ratio**2).imag / scale**2 - ratio.imag * ratio.real / scale**2
        return PathPoint(value, float(np.angle(first)), curvature, bending)

    def curvature(at: Array) -> Array:
        _, first, second, _ = derivatives(at)
        out: Array = np.abs((second / first).imag) / np.abs(first)
        return out

    # The largest curvature of a stretch, from points close together, with the ends of both polynomials at a knot.
    inside = grid[:-1, None] + np.diff(grid)[:, None] * np.linspace(0, 1 - 1e-12, 5)
    return Path(curve, profile(arc, curvature(inside).max(1) * (1 + 1e-3), limits or Limits()))


def _along(piece: Line | Arc, length: float, position: complex, heading: float) -> PathPoint:
    start = position.real, position.imag, heading
    x, y, direction = compose(start, exp((length, 0.0, piece.curvature * length))).tolist()
    return PathPoint(complex(x, y), direction, piece.curvature, 0.0)


def _points(points: ArrayLike) -> Complex:
    rows = array("points", points, (None, 2))
    if len(rows) < 2:
        raise InputError(f"points: got {len(rows)}, expected at least two")
    out = as_complex(rows)
    same = np.flatnonzero(np.abs(np.diff(out)) < 1e-9)
    if same.size:
        raise InputError(f"points: got {rows[same[0]].tolist()} twice in sequence, expected different points")
    return out


def _sharers(corners: int, *, first: bool) -> Array:
    """How many corners cut the line before (or after) each corner."""
    shares = np.full(corners, 2.0)
    if corners:
        shares[0 if first else -1] = 1.0
    return shares


def _natural(knots: Array, values: Complex) -> Complex:
    """Second derivatives of a natural cubic spline at its knots (tridiagonal, solved as a small dense system)."""
    k, h = len(knots), np.diff(knots)
    matrix, right = np.eye(k), np.zeros(k, dtype=complex)
    for i in range(1, k - 1):
        matrix[i, i - 1 : i + 2] = h[i - 1], 2 * (h[i - 1] + h[i]), h[i]
        right[i] = 6 * ((values[i + 1] - values[i]) / h[i] - (values[i] - values[i - 1]) / h[i - 1])
    out: Complex = np.linalg.solve(matrix, right).astype(np.complex128)
    return out


def _lengths(grid: Array, derivatives: Callable[[Array], tuple[Array, ...]]) -> Array:
    """Lengths between the grid's parameters by Gauss quadrature of the speed."""
    half: Array = np.diff(grid) / 2
    at = (grid[:-1] + half)[:, None] + half[:, None] * _NODES
    out: Array = half * (np.abs(derivatives(at)[1]) @ _WEIGHTS)
    return out
