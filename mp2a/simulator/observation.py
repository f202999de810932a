"""What simulated robots know; without geometry, so that a rank that is a robot alone needs none."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array


class Observation(NamedTuple):
    """What the robots know at one time."""

    time: float
    """s"""
    poses: Array
    """``(n, 3)`` m, m, rad in the ground frame, without error; headings are not wrapped."""
    twists: Array
    """``(n, 2)`` m/s and rad/s."""
    points: list[Array]
    """n arrays ``(k, 2)`` m: the latest scan that has arrived, in the robot's own frame at the time of the scan. Empty,
    as all that follows is, of robots without LIDAR."""
    stamps: Array
    """``(n,)`` s: when that scan was taken."""
    arrivals: Array
    """``(n,)`` s: when it arrived."""
    new: NDArray[np.bool_]
    """``(n,)`` whether it arrived during the last step, or is the first."""

    @property
    def news(self) -> list[Array | None]:
        """The scans that have just arrived, ``(k, 2)`` each; None for a robot that has got nothing new."""
        return [points if new else None for points, new in zip(self.points, self.new, strict=True)]
