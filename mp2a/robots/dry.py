"""A dry run: an ideal robot that exists only here."""

import numpy as np

from mp2a.formation.choreography.fleet import Fleet
from mp2a.formation.choreography.ideal import obey
from mp2a.formation.robot_models import RobotModel
from mp2a.robots.interface import Sensed
from mp2a.spatial import Array


class VirtualPace:
    """Time that passes as fast as the loop runs; ``advance`` moves the robots by a tick.

    Parameters
    ----------
    period
        s a tick.
    robots
        What moves; each has ``advance(dt)``.
    """

    def __init__(self, period: float, robots: "list[DryRobot]") -> None:
        self._period, self._robots = period, robots
        self._tick = 0

    def now(self) -> float:
        """Tell the time since the start, s."""
        return self._tick * self._period

    def wait(self, done: bool = False) -> bool:
        """Let a tick pass; returns ``done``."""
        for robot in self._robots:
            robot.advance(self._period)
        self._tick += 1
        return done


class DryRobot:
    """Does exactly what it is told, within its limits of speed and acceleration; sees nothing, slips nowhere.

    Parameters
    ----------
    model
        Its limits.
    pose
        ``(3,)`` where it stands, m and rad.
    """

    has_lidar = False

    def __init__(self, model: RobotModel, pose: Array) -> None:
        self._fleet = Fleet.of([model])
        self._pose = np.array(pose, dtype=float)[None]
        self._twist = np.zeros((1, 2))
        self._command = np.zeros((1, 2))

    def advance(self, dt: float) -> None:
        """Drive for ``dt`` s."""
        self._pose, self._twist = obey(self._fleet, self._pose, self._twist, self._command, dt)

    def sense(self) -> Sensed:
        """Tell where it is."""
        return Sensed(self._pose[0].copy(), self._twist[0].copy(), None)

    def send(self, command: Array) -> None:
        """Take a command."""
        self._command = np.array(command, dtype=float)[None]

    def warn(self, text: str | None) -> None:
        """Say nothing: it never sees what it would warn of."""

    def close(self) -> None:
        """Stand."""
        self._command = np.zeros((1, 2))
