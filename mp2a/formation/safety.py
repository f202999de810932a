"""A robot's own safety (thesis, chapter 5): signals that keep it from driving into something, and its error state.

Whoever plans for robots passes its commands through `safe_commands`; it never has the last word itself.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array
from mp2a.formation.constants import (
    HIGHEST,
    LOST_POSES,
    LOWEST,
    SILENCE,
    STOP_DISTANCE,
    STOP_SIDE,
    TURN_AHEAD,
    TURN_SIDE,
)
from mp2a.spatial import Array

_TURNS = 5
"""Steps in which a turn is looked ahead; between two a HUSKY's corner moves by 6 cm."""
_ROUNDING = 1e-9
"""s"""

Flags = NDArray[np.bool_]


class StopSignals(NamedTuple):
    """What the points that robots see keep them from, ``(n,)`` each."""

    front: Flags
    """Something is in the way forwards."""
    rear: Flags
    """Something is in the way backwards."""
    left: Flags
    """A turn to the left would bring the body against a point. The thesis has no such signal; without one, a robot that
    stands close to a wall touches it with a corner as it turns."""
    right: Flags

    def blocked(self, commands: Array) -> Flags:
        """Return which of the commands ``(n, 2)`` would drive into something."""
        return (self.front & (commands[:, 0] > 0)) | (self.rear & (commands[:, 0] < 0))

    def turn_held(self, commands: Array) -> Flags:
        """Return which of the commands ``(n, 2)`` would turn onto something."""
        return (self.left & (commands[:, 1] > 0)) | (self.right & (commands[:, 1] < 0))


def stop_signals(points: Array, robot: NDArray[np.intp], lengths: Array, widths: Array) -> StopSignals:
    """Work out the signals of n robots.

    Parameters
    ----------
    points
        ``(k, 2)`` in the frame of the robot that sees them, m; what is not finite is not there.
    robot
        ``(k,)``: which robot.
    lengths, widths
        ``(n,)`` of the robots, m.
    """
    half, side = lengths[robot] / 2, widths[robot] / 2
    near = np.abs(points).max(axis=1, initial=0.0) < half + side + max(STOP_DISTANCE, TURN_SIDE)
    points, robot, half, side = points[near], robot[near], half[near], side[near]
    lane = np.abs(points[:, 1]) < side + STOP_SIDE
    ahead = lane & (points[:, 0] > 0) & (points[:, 0] < half + STOP_DISTANCE)
    behind = lane & (points[:, 0] < 0) & (points[:, 0] > -half - STOP_DISTANCE)
    turns = (_swept(points, np.stack((half, side), axis=-1), way) for way in (1.0, -1.0))
    return StopSignals(*(np.bincount(robot[which], minlength=len(lengths)) > 0 for which in (ahead, behind, *turns)))


def safe_commands(commands: Array, fastest: Array, signals: StopSignals, stopped: Flags) -> Array:
    """Return commands that robots may be sent.

    Parameters
    ----------
    commands
        ``(n, 2)``, m/s and rad/s.
    fastest
        ``(n, 2)`` or ``(2,)`` limits of both.
    signals
        What is in the robots' way.
    stopped
        ``(n,)``: which robots are to stand, because they have failed or do not know where they are.
    """
    out: Array = np.clip(commands, -fastest, fastest)
    out[signals.blocked(commands), 0] = 0.0
    out[signals.turn_held(commands), 1] = 0.0
    out[stopped] = 0.0
    return out


class ErrorStates(NamedTuple):
    """Which of n robots have failed, for good, and what is remembered to tell (section 5.1)."""

    last_scan_time: Array
    """``(n,)`` s: when LIDAR data came last; not a number of robots that have no LIDAR or have not begun."""
    lost_poses: NDArray[np.intp]
    """``(n,)``: look-ups of the pose that failed in a row."""
    lost: Flags
    """``(n,)``: which robots have failed because their pose was lost."""
    silent: Flags
    """``(n,)``: which have failed because their LIDAR was silent."""

    @classmethod
    def none(cls, n: int, last_scan_time: float = np.nan) -> "ErrorStates":
        """Return the states of n robots that are well."""
        return cls(np.full(n, last_scan_time), np.zeros(n, dtype=np.intp), *np.zeros((2, n), dtype=bool))

    @property
    def failed(self) -> Flags:
        """Which robots have failed, ``(n,)``."""
        return self.lost | self.silent

    def cause(self, robot: int) -> str:
        """Return what brought a robot into its error state; empty if it is not in it."""
        return "its pose was lost" if self.lost[robot] else "its LIDAR was silent" if self.silent[robot] else ""

    def after_look_up(self, located: Flags) -> "ErrorStates":
        """Return the states after the poses have been looked up: a robot fails with the third loss in a row."""
        count = np.where(located, 0, self.lost_poses + 1)
        return self._replace(lost_poses=count, lost=self.lost | (count >= LOST_POSES) & ~self.silent)

    def after_scan(self, time: float, arrived: Flags) -> "ErrorStates":
        """Return the states at a time in s: a robot fails when the last data are older than `SILENCE`.

        What is missing before the start, time 0, is missing from the start on.
        """
        last = np.where(arrived | np.isnan(self.last_scan_time) | (time < 0), time, self.last_scan_time)
        return self._replace(last_scan_time=last, silent=self.silent | (time - last > SILENCE + _ROUNDING) & ~self.lost)


def from_cloud(cloud: ArrayLike) -> Array:
    """Return the points ``(k, 2)`` of a 3-D cloud ``(k, 3)`` that are in the way: neither floor nor ceiling.

    Raises
    ------
    InputError
        If the cloud is not ``(k, 3)``.
    """
    points = array("cloud", cloud, (None, 3), finite=False)
    height = points[:, 2]
    out: Array = points[(height > LOWEST) & (height < HIGHEST), :2]
    return out


def _swept(points: Array, size: Array, way: float) -> Flags:
    """Return which points a body of half sizes ``(k, 2)`` meets if it turns, ``way`` 1 to the left, -1 to the right.

    Points that are within TURN_SIDE of the body from the start are met if the turn brings them nearer.
    """
    met = np.zeros(len(points), dtype=bool)
    for angle in way * TURN_AHEAD * np.arange(1, _TURNS + 1) / _TURNS:
        c, s = np.cos(angle), np.sin(angle)
        turned = points @ np.array([[c, -s], [s, c]])
        met |= (np.abs(turned) < size + TURN_SIDE).all(axis=-1)
    body = np.clip(points, -size, size)  # what of it is nearest to each point, and goes to its left or right
    towards = way * (body[:, 0] * (points - body)[:, 1] - body[:, 1] * (points - body)[:, 0])
    close = (np.abs(points) < size + TURN_SIDE).all(axis=-1)
    out: Flags = np.where(close, towards > 0, met)
    return out
