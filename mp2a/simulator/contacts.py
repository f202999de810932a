"""Which robots touch a wall, an obstacle or one another, and how far each may move before it does."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.constants import STOP_DISTANCE, STOP_SIDE
from mp2a.se2 import compose
from mp2a.simulator.vehicle import drive_arcs
from mp2a.simulator.world import World, geometry, rectangles
from mp2a.spatial import Array

_HALVINGS = 12
Pairs = NDArray[np.intp]


class Advance(NamedTuple):
    """What became of a move."""

    poses: Array
    """``(n, 3)``, in which nobody touches anything."""
    blocked: NDArray[np.bool_]
    """``(n,)`` who would have touched something, and was stopped in front of it."""
    pairs: Pairs
    """``(p, 2)`` who drove, and into what: another robot's number, or n + the number of a shape."""


class Contacts:
    """Robots' rectangles in a world.

    Parameters
    ----------
    world
        Its shapes do not move.
    lengths, widths
        ``(n,)`` m of the robots.
    """

    def __init__(self, world: World, lengths: Array, widths: Array) -> None:
        self._shapely = shapely = geometry()
        self._lengths, self._widths = lengths, widths
        self._shapes = world.shapes
        self._tree = shapely.STRtree(self._shapes)

    def outlines(self, poses: Array) -> Any:
        """Return robots at poses ``(n, 3)`` as ``n`` shapely polygons."""
        return self._shapely.polygons(rectangles(poses, self._lengths, self._widths))

    def touching(self, poses: Array) -> Pairs:
        """Return the pairs ``(p, 2)`` that touch: robots with the lower number first, then robots with shapes."""
        outlines = self.outlines(poses)
        robots = self._shapely.STRtree(outlines).query(outlines, predicate="intersects").T
        shapes = self._tree.query(outlines, predicate="intersects").T + np.array((0, len(outlines)))
        pairs = np.concatenate((robots[robots[:, 0] < robots[:, 1]], shapes))
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def advance(self, poses: Array, twists: Array, dt: float) -> Advance:
        """Move robots along arcs; those that would touch something stop just before.

        Parameters
        ----------
        poses
            ``(n, 3)`` in which nobody touches anything.
        twists
            ``(n, 2)`` m/s and rad/s.
        dt
            s

        Returns
        -------
        Advance
            A robot that would have driven into something has moved for a part of the time, found by halving, or not
            at all where that would bring it in another's way. One that is only driven into goes on.
        """
        n = len(poses)
        moved = drive_arcs(poses, twists, dt)
        pairs = self.touching(moved)
        if not len(pairs):
            return Advance(moved, np.zeros(n, dtype=bool), pairs)
        pairs, held = self._who_drove(poses, moved, pairs)
        # Whoever is stopped may stand in the way of one who was free, so the blocked ones grow until nobody is.
        while len(new := self.touching(np.where(held[:, None], poses, moved))):
            late = new[:, 1] < n
            late[late] = held[new[late, 0]]
            new[late] = new[late, ::-1]
            held |= _robots(new, n)
            pairs = np.concatenate((pairs, new))
        free, met = np.zeros(n), np.ones(n)
        for _ in range(_HALVINGS):
            middle = (free + met) / 2
            tried = drive_arcs(poses, twists, np.where(held, middle, 1.0) * dt)
            hit = _robots(self.touching(tried), n)
            free, met = np.where(hit, free, middle), np.where(hit, middle, met)
        share = np.where(held, free, 1.0)
        while (left := _robots(self.touching(drive_arcs(poses, twists, share * dt)), n) & (share > 0)).any():
            share[left] = 0.0
            held |= left
        return Advance(drive_arcs(poses, twists, share * dt), held, np.unique(pairs, axis=0))

    def _who_drove(self, poses: Array, moved: Array, pairs: Pairs) -> tuple[Pairs, NDArray[np.bool_]]:
        """Tell who of each pair drove into the other, who is put first; and who of all robots drove into anything.

        A robot did if it alone, moved, touches the other where that was before; if neither did alone, both did.
        """
        n = len(poses)
        before, after = self.outlines(poses), self.outlines(moved)
        driven = np.stack((np.ones(len(pairs), dtype=bool), np.zeros(len(pairs), dtype=bool)), axis=1)
        both = pairs[:, 1] < n
        i, j = pairs[both].T
        intersects = self._shapely.intersects
        alone = np.stack((intersects(after[i], before[j]), intersects(before[i], after[j])), axis=1)
        driven[both] = alone | ~alone.any(axis=1, keepdims=True)
        held = np.zeros(n, dtype=bool)
        held[pairs[driven]] = True
        return np.where(driven[:, :1], pairs, pairs[:, ::-1]), held

    def place(self, poses: Array, robot: int, other: int) -> Array:
        """Return the middle ``(2,)`` m of the gap between a robot and what it met, as numbered by `touching`."""
        things = np.concatenate((self.outlines(poses), self._shapes))
        shortest = self._shapely.shortest_line(things[robot], things[other])
        out: Array = self._shapely.get_coordinates(shortest).mean(axis=0)
        return out

    def in_the_way(self, poses: Array, robot: int, direction: int) -> int | None:
        """Return what is nearest in a robot's stop zone ahead (``direction`` 1) or behind (-1); None if nothing is.

        Robots and shapes are numbered as by `touching`.
        """
        length, width = STOP_DISTANCE, self._widths[robot] + 2 * STOP_SIDE
        middle = compose(poses[robot], np.array([direction * (self._lengths[robot] + length) / 2, 0.0, 0.0]))
        [zone] = self._shapely.polygons(rectangles(middle[None], np.array([length]), np.array([width])))
        things = np.concatenate((self.outlines(poses), self._shapes))
        inside = np.flatnonzero(self._shapely.intersects(things, zone))
        inside = inside[inside != robot]
        if not len(inside):
            return None
        return int(inside[np.argmin(self._shapely.distance(things[inside], things[robot]))])


def _robots(pairs: Pairs, n: int) -> NDArray[np.bool_]:
    """Tell who of n robots is in a pair."""
    out = np.zeros(n + 1, dtype=bool)
    out[np.minimum(pairs.reshape(-1), n)] = True
    return out[:n]
