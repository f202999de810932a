"""Robots of the 2-D simulator, or ideal ones, behind the interface of real ones; in one process or a rank a robot."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mp2a.robots.adapters import AdapterConfig, AdapterResult
from mp2a.robots.interface import Sensed
from mp2a.simulator import Simulation, World, read_world
from mp2a.simulator.ideal import IdealSimulation
from mp2a.simulator.observation import Observation
from mp2a.simulator.outcomes import touched
from mp2a.spatial import Array

if TYPE_CHECKING:
    from mp2a.mpi import MPI


def make(config: AdapterConfig) -> AdapterResult:
    """Make the simulation, and the robots of this process."""
    file, roles = config.file, tuple(config.file.configs)
    models = [robot.model for robot in file.configs.values()]
    simulation: Simulation | IdealSimulation
    if file.adapter == "dry":
        simulation = IdealSimulation(models, config.places)
    else:
        world = World() if file.world is None else read_world(file.world)
        simulation = Simulation(world, models, config.places)
    clock = SimulationClock(simulation, config.period, [roles.index(role) for role in config.roles], config.comm)
    return AdapterResult(clock.robots, clock, touched=lambda: touched(simulation, roles))


class SimulationClock:
    """Time of a simulation: a tick gives everybody's commands to it and lets it go on.

    With a communicator every rank has the same simulation and one robot of it. Commands are exchanged each tick; since
    the same calls give the same numbers, all ranks simulate the same.

    Parameters
    ----------
    simulation
        Of all robots.
    period
        s a tick.
    own
        Numbers of the robots that this process drives, from 0.
    comm
        With as many ranks as robots; None: all are driven here.

    Attributes
    ----------
    robots : list of SimulatedRobot
        Those of this process.
    sensed
        What all robots know at this tick.
    """

    def __init__(
        self,
        simulation: Simulation | IdealSimulation,
        period: float,
        own: Sequence[int],
        comm: "MPI.Comm | None" = None,
    ) -> None:
        self.simulation = simulation
        self._period, self._comm = period, comm
        self.sensed: Observation = simulation.sense()
        self._commands = np.zeros((len(self.sensed.poses), 2))
        self.robots = [SimulatedRobot(self, number) for number in own]

    def now(self) -> float:
        """Return the simulated time, s."""
        return self.simulation.time

    def give(self, number: int, command: Array) -> None:
        """Set one robot's command."""
        self._commands[number] = command

    def wait(self, done: bool = False) -> bool:
        """Simulate a tick; returns whether all are done."""
        commands = self._commands
        if self._comm is not None:
            rows = self._comm.allgather((commands[self._comm.rank].tolist(), done))
            commands, done = np.array([row for row, _ in rows]), all(other for _, other in rows)
        self.step(commands, self._period)
        return done

    def step(self, commands: Array, dt: float) -> None:
        """Simulate ``dt`` s with commands ``(n, 2)``."""
        self.simulation.step(commands, dt)
        self.sensed = self.simulation.sense()


class SimulatedRobot:
    """One robot of a simulation."""

    def __init__(self, clock: SimulationClock, number: int) -> None:
        self._clock, self._number = clock, number
        self.has_lidar = bool(clock.sensed.points)

    def sense(self) -> Sensed:
        """Return what the simulator says."""
        seen, i = self._clock.sensed, self._number
        return Sensed(seen.poses[i], seen.twists[i], seen.news[i] if seen.points else None)

    def send(self, command: Array) -> None:
        """Take a command for the next tick."""
        self._clock.give(self._number, command)

    def warn(self, text: str | None) -> None:
        """Say nothing: nobody is there to hear it."""

    def close(self) -> None:
        """Stand."""
        self._clock.give(self._number, np.zeros(2))
