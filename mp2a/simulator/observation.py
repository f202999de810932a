"""What robots know, and what is told of them; without geometry, so that a rank that is a robot alone needs none."""

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
    """n arrays ``(k, 2)`` m: the latest scan that has arrived, in the robot's own frame at the time of the scan."""
    stamps: Array
    """``(n,)`` s: when that scan was taken."""
    arrivals: Array
    """``(n,)`` s: when it arrived."""
    new: NDArray[np.bool_]
    """``(n,)`` whether it arrived during the last step, or is the first."""

    @property
    def news(self) -> list[Array | None]:
        """Only the scans that have just arrived; None for a robot that has got nothing new."""
        return [points if new else None for points, new in zip(self.points, self.new, strict=True)]


class Event(NamedTuple):
    """Something worth telling."""

    time: float
    """s"""
    robot: int
    """From 0."""
    place: tuple[float, float]
    """m in the ground frame."""
    text: str


STATES = (
    ("is in its error state and stays there", ""),
    ("stops: something is in its way", "goes on"),
    ("has an obstacle inside its radius", ""),
    ("is far behind and catches up", "has caught up"),
)
"""States of a robot that are worth telling: when it begins, and when it ends. Their order is that of `Changes.tell`."""


class Changes:
    """Tells when robots come into states and leave them.

    Parameters
    ----------
    robots
        Numbers of the m robots.
    """

    def __init__(self, robots: NDArray[np.intp]) -> None:
        self._robots = robots
        self._was = np.zeros((len(STATES), len(robots)), dtype=bool)

    def tell(self, sensed: Observation, *now: NDArray[np.bool_]) -> list[Event]:
        """Events since the last call, for the `STATES` ``(m,)`` each: error, stopped, contact, far behind."""
        states = np.stack(now)
        out = []
        for what, k in np.argwhere(states != self._was):
            if text := STATES[what][int(not states[what, k])]:
                x, y, _ = sensed.poses[k]
                i = int(self._robots[k])
                out.append(Event(sensed.time, i, (float(x), float(y)), f"robot {i + 1} {text}"))
        self._was = states
        return out
