"""A dry run: an ideal robot that exists only here."""

import numpy as np

from mp2a.formation.robot_models import RobotModel
from mp2a.robots.adapters import AdapterConfig, AdapterResult
from mp2a.robots.clock import VirtualClock
from mp2a.robots.interface import Sensed
from mp2a.simulator.ideal import IdealSimulation
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
        self._simulation = IdealSimulation([model], [pose])
        self._command = np.zeros((1, 2))

    def advance(self, t: float) -> None:
        """Drive until ``t`` s."""
        self._simulation.step(self._command, t - self._simulation.time)

    def sense(self) -> Sensed:
        """Return where it is."""
        sensed = self._simulation.sense()
        return Sensed(sensed.poses[0], sensed.twists[0], None)

    def send(self, command: Array) -> None:
        """Take a command."""
        self._command = np.array(command, dtype=float)[None]

    def warn(self, text: str | None) -> None:
        """Say nothing: it never sees what it would warn of."""

    def close(self) -> None:
        """Stand."""
        self._command = np.zeros((1, 2))
