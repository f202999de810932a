"""How close robots come to each other and to walls, and when."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.constants import TICK
from mp2a.simulator.world import World, geometry, rectangles
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
    gap: float
    """m that are free between their bodies at the least; 0 if they overlap."""


def stretches(ticks: NDArray[np.intp], pause: int = PAUSE) -> list[NDArray[np.intp]]:
    """Split rising ticks where they are more than a pause apart."""
    return np.split(ticks, np.flatnonzero(np.diff(ticks) > pause) + 1) if len(ticks) else []


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
    radius, rows = np.hypot(*sizes.T) / 2, [np.empty((0, 3))]
    chunk = max(1, _CHUNK // max(len(first), 1))
    for begin in range(0, len(poses), chunk):
        part = poses[begin : begin + chunk]
        distance = np.hypot(*np.moveaxis(part[:, second, :2] - part[:, first, :2], -1, 0))
        tick, pair = np.nonzero(distance < radius[first] + radius[second] + margin)
        bodies = (_bodies(part[tick, who[pair]], sizes[who[pair]]) for who in (first, second))
        rows.append(np.column_stack((pair, tick + begin, geometry().distance(*bodies))))
    pairs, ticks, gaps = np.concatenate(rows).T
    out = []
    for pair in np.unique(pairs[gaps < margin]).astype(np.intp):
        close = (pairs == pair) & (gaps < margin)
        at = ticks[close].astype(np.intp)
        for stretch in stretches(at, pause):
            gap = float(gaps[close][np.isin(at, stretch)].min())
            out.append(CloseApproach(int(first[pair]), int(second[pair]), int(stretch[0]), int(stretch[-1]), gap))
    return sorted(out, key=lambda approach: (approach.begin, approach.first, approach.second))


def wall_gaps(poses: Array, size: Array, world: World) -> Array:
    """Return the distance ``(T,)`` m of a robot of ``size`` ``(2,)`` m at ``(T, 3)`` from walls and obstacles."""
    shapely = geometry()
    everything = shapely.union_all(world.shapes)
    shapely.prepare(everything)
    out: Array = shapely.distance(_bodies(poses, np.broadcast_to(size, (len(poses), 2))), everything)
    return np.where(np.isnan(out), np.inf, out)  # an empty world is at no distance


def _bodies(poses: Array, sizes: Array) -> NDArray[np.object_]:
    out: NDArray[np.object_] = geometry().polygons(rectangles(poses, *sizes.T))
    return out
