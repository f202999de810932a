"""A dry run: an ideal robot that exists only here."""

import numpy as np

from mp2a.formation.choreography.fleet import Fleet
from mp2a.formation.choreography.ideal import obey
from mp2a.formation.robot_models import RobotModel
from mp2a.robots.adapters import AdapterConfig, AdapterResult
from mp2a.robots.clock import VirtualClock
from mp2a.robots.interface import Sensed
from mp2a.spatial import Array


def make(config: AdapterConfig) -> AdapterResult:
    """Make the robots of this process."""
    places = dict(zip(config.robots, config.places, strict=True))
    robots = [DryRobot(config.robots[role].model, places[role]) for role in config.roles]
    return AdapterResult(robots, VirtualClock(config.period, robots))


class DryRobot:
    """Does exactly what it is told, within its limits of speed and acceleration; sees nothing, slips nowhere.

    Parameters
    ----------
    model
        Its limits.
    pose
        ``(3,)`` where it stands, m and rad.
    """

    has_lidar = over = False

    def __init__(self, model: RobotModel, pose: Array) -> None:
        self._fleet = Fleet.of([model])
        self._pose = np.array(pose, dtype=float)[None]
        self._twist = np.zeros((1, 2))
        self._command = np.zeros((1, 2))
        self._time = 0.0

    def advance(self, t: float) -> None:
        """Drive until ``t`` s."""
        self._pose, self._twist = obey(self._fleet, self._pose, self._twist, self._command, t - self._time)
        self._time = t

    def sense(self) -> Sensed:
        """Return where it is."""
        return Sensed(self._pose[0].copy(), self._twist[0].copy(), None)

    def send(self, command: Array) -> None:
        """Take a command."""
        self._command = np.array(command, dtype=float)[None]

    def warn(self, text: str | None) -> None:
        """Say nothing: it never sees what it would warn of."""

    def close(self) -> None:
        """Stand."""
        self._command = np.zeros((1, 2))
