"""Ideal robots: they do exactly what they are told, within their limits; nothing slips, nothing is in the way."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array
from mp2a.formation.robot_models import Fleet, RobotModel
from mp2a.simulator.events import RobotEvent
from mp2a.simulator.observation import Observation
from mp2a.simulator.vehicle import drive_arcs, speeds_after
from mp2a.spatial import Array


class IdealSimulation:
    """Ideal robots without LIDAR on an empty plane, used as a `mp2a.simulator.Simulation` is.

    Parameters
    ----------
    models
        One for each robot.
    poses
        ``(n, 3)`` m, m, rad in the ground frame at time 0.

    Attributes
    ----------
    time : float
        s
    """

    collisions: Sequence[RobotEvent] = ()

    def __init__(self, models: Sequence[RobotModel], poses: ArrayLike) -> None:
        self.fleet = Fleet.of(models)
        self.time = 0.0
        self._poses: Array = array("poses", poses, (len(models), 3))
        self._twists: Array = np.zeros((len(models), 2))

    def sense(self) -> Observation:
        """Return what every robot knows now."""
        nothing = np.empty(0)
        return Observation(self.time, self._poses, self._twists, [], nothing, nothing, nothing > 0)

    def step(self, commands: ArrayLike, dt: float) -> None:
        """Let the robots obey commands ``(n, 2)``, m/s and rad/s, for ``dt`` s."""
        self._poses, self._twists = obey(self.fleet, self._poses, self._twists, np.asarray(commands), dt)
        self.time = round(self.time + dt, 9)


def obey(fleet: Fleet, poses: Array, twists: Array, commands: Array, dt: float) -> tuple[Array, Array]:
    """Return poses ``(n, 3)`` and twists ``(n, 2)`` after ``dt`` s: speeds follow commands as limits allow."""
    wanted = np.clip(commands, -fleet.fastest, fleet.fastest)
    reached = speeds_after(twists, wanted, fleet.accelerations, dt)
    return drive_arcs(poses, reached, dt), reached
