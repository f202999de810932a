"""Rectangles on the ground that come too close to each other, and when."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.constants import TICK
from mp2a.se2 import rotate
from mp2a.spatial import Array

PAUSE = round(1.0 / TICK)
"""Ticks between two times of one finding up to which they count as one."""
_CHUNK = 200_000
"""Pairs and ticks looked at together."""


class CloseApproach(NamedTuple):
    """Two robots closer than a margin, over some ticks."""

    first: int
    second: int
    begin: int
    end: int
    """Last tick of it."""
    overlap: bool
    """Whether their bodies overlap."""


def stretches(ticks: NDArray[np.intp], pause: int = PAUSE) -> list[NDArray[np.intp]]:
    """Split rising ticks where they are more than a pause apart."""
    return np.split(ticks, np.flatnonzero(np.diff(ticks) > pause) + 1) if len(ticks) else []


def overlaps(offset: Array, heading: Array, size: Array, other_heading: Array, other_size: Array) -> NDArray[np.bool_]:
    """Return whether rectangles overlap or touch, by the separating axis theorem.

    Parameters
    ----------
    offset
        From the centre of one to the centre of the other, ``(..., 2)`` m.
    heading, size
        Of the one: rad, and ``(..., 2)`` half lengths along its own axes, m.
    other_heading, other_size
        Of the other.
    """
    c, s = np.abs(np.cos(other_heading - heading)), np.abs(np.sin(other_heading - heading))
    apart = np.zeros(offset.shape[:-1], dtype=bool)
    for angle, own, far in ((heading, size, other_size), (other_heading, other_size, size)):
        x, y = np.moveaxis(np.abs(rotate(-angle, offset)), -1, 0)
        apart |= x > own[..., 0] + c * far[..., 0] + s * far[..., 1]
        apart |= y > own[..., 1] + s * far[..., 0] + c * far[..., 1]
    return ~apart


def close_pairs(poses: Array, sizes: Array, margin: float, pause: int = PAUSE) -> list[CloseApproach]:
    """Find who comes too close to whom and when.

    Parameters
    ----------
    poses
        ``(T, n, 3)`` m and rad.
    sizes
        ``(n, 2)`` lengths and widths, m.
    margin
        What is to stay free between two bodies, m.
    pause
        Times of a pair that are at most so many ticks apart are reported as one.

    Returns
    -------
    list of CloseApproach
        Sorted by when they begin.
    """
    first, second = np.triu_indices(poses.shape[1], 1)
    half, rows = sizes / 2, [np.empty((0, 3), dtype=np.intp)]
    reach = np.hypot(*half.T)
    chunk = max(1, _CHUNK // max(len(first), 1))
    for begin in range(0, len(poses), chunk):
        part = poses[begin : begin + chunk]
        offset = part[:, second, :2] - part[:, first, :2]
        near = np.hypot(offset[..., 0], offset[..., 1]) <= reach[first] + reach[second] + 2 * margin
        tick, pair = np.nonzero(near)
        a, b = first[pair], second[pair]
        there = offset[tick, pair], part[tick, a, 2]
        which = overlaps(*there, half[a] + margin / 2, part[tick, b, 2], half[b] + margin / 2)
        touch = overlaps(*there, half[a], part[tick, b, 2], half[b])
        rows.append(np.column_stack((pair, tick + begin, touch))[which].astype(np.intp))
    pairs, ticks, touches = np.concatenate(rows).T
    out = []
    for pair in np.unique(pairs):
        times, contacts = ticks[pairs == pair], ticks[(pairs == pair) & (touches > 0)]
        for stretch in stretches(times, pause):
            met = bool(np.isin(contacts, stretch).any())
            out.append(CloseApproach(int(first[pair]), int(second[pair]), int(stretch[0]), int(stretch[-1]), met))
    return sorted(out, key=lambda approach: (approach.begin, approach.first, approach.second))
