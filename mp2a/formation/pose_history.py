"""Where robots were a moment ago, so that what a sensor saw then can be put where it is now."""

import numpy as np
from numpy.typing import ArrayLike

from mp2a.se2 import wrap
from mp2a.spatial import Array

MEMORY = 1.0
"""s of the past that are remembered; LIDAR data of the thesis are 0.3 s old."""


class PoseHistory:
    """The poses of m robots in the last second.

    Parameters
    ----------
    m
        How many robots.
    """

    def __init__(self, m: int) -> None:
        self._times = np.empty(0)
        self._poses = np.empty((0, m, 3))

    def add(self, time: float, poses: Array) -> None:
        """Remember poses ``(m, 3)`` at a time in s that is later than those before."""
        kept = self._times > time - MEMORY
        self._times = np.append(self._times[kept], time)
        self._poses = np.concatenate((self._poses[kept], np.asarray(poses)[None]))

    def at(self, stamps: ArrayLike) -> Array:
        """Return poses ``(m, 3)`` at a time for each robot, ``(m,)`` s; at the ends of the memory what it has there."""
        wanted = np.clip(stamps, self._times[0], self._times[-1])
        last = len(self._times) - 1
        late = np.clip(np.searchsorted(self._times, wanted, side="right"), min(1, last), last)
        early, robots = np.maximum(late - 1, 0), np.arange(len(wanted))
        span = self._times[late] - self._times[early]
        share = np.where(span > 0, (wanted - self._times[early]) / np.where(span > 0, span, 1.0), 1.0)[:, None]
        before, after = self._poses[early, robots], self._poses[late, robots]
        change = after - before
        change[:, 2] = wrap(change[:, 2])
        return before + share * change
