"""Where robots were a moment ago, so that what a sensor saw then can be put where it is now."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.se2 import wrap
from mp2a.spatial import Array

MEMORY = 1.0
"""s of the past that are remembered; LIDAR data of the thesis are 0.3 s old."""


class PoseHistory(NamedTuple):
    """The poses of m robots in the last second."""

    times: Array
    """``(t,)`` s, rising"""
    poses: Array
    """``(t, m, 3)``"""

    @classmethod
    def empty(cls, m: int) -> "PoseHistory":
        """Remember nothing yet of m robots."""
        return cls(np.empty(0), np.empty((0, m, 3)))

    def add(self, time: float, poses: Array) -> "PoseHistory":
        """Remember poses ``(m, 3)`` at a time in s; one that is not finite counts as the one before."""
        kept = (self.times > time - MEMORY) & (self.times < time)
        before = self.poses[-1] if len(self.poses) else poses
        known = np.where(np.isfinite(poses).all(axis=1, keepdims=True), poses, before)
        return PoseHistory(np.append(self.times[kept], time), np.concatenate((self.poses[kept], known[None])))

    def at(self, stamps: ArrayLike) -> Array:
        """Return poses ``(m, 3)`` at a time for each robot, ``(m,)`` s; at the ends of the memory what it has there."""
        wanted = np.clip(stamps, self.times[0], self.times[-1])
        last = len(self.times) - 1
        late = np.clip(np.searchsorted(self.times, wanted, side="right"), min(1, last), last)
        early, robots = np.maximum(late - 1, 0), np.arange(len(wanted))
        span = self.times[late] - self.times[early]
        share = np.where(span > 0, (wanted - self.times[early]) / np.where(span > 0, span, 1.0), 1.0)[:, None]
        before, after = self.poses[early, robots], self.poses[late, robots]
        change = after - before
        change[:, 2] = wrap(change[:, 2])
        return before + share * change
