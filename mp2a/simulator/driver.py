"""What drives simulated robots: the part that a choreography and a march by dynamics share."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.simulator.events import RobotEvent, StateChanges
from mp2a.simulator.observation import Observation
from mp2a.spatial import Array


class Ending(NamedTuple):
    """What the m robots of a process know of their own end."""

    places: Array
    """``(m, 2)``: where they are to be, m in the ground frame."""
    over: NDArray[np.bool_]
    """``(m,)``: whether their leader is through."""
    errors: tuple[str, ...]
    """What brought each into its error state; empty if it is not in it."""
    blocked: NDArray[np.intp]
    """``(m,)``: 1 if a stop signal keeps it from driving forwards, -1 backwards, 0 if none does."""

    @classmethod
    def of_all(cls, parts: "Sequence[Ending]") -> "Ending":
        """Join what the robots of all processes know, in the order of the robots."""
        places, over, errors, blocked = zip(*parts, strict=True)
        causes = tuple(cause for own in errors for cause in own)
        return cls(np.concatenate(places), np.concatenate(over), causes, np.concatenate(blocked))


class SimulationDriver:
    """Drives some robots of a simulation, all of them or those of one rank: observations go in, commands come out.

    Parameters
    ----------
    robots
        Numbers of the m robots.

    Attributes
    ----------
    robots
        The same.
    events : list of RobotEvent
        States that robots came into and left so far.
    leaders : list of ndarray
        ``(m, 3)`` of every step: place of what each robot followed, and the distance it was to have from there, m.
    """

    def __init__(self, robots: NDArray[np.intp]) -> None:
        self.robots = robots
        self.events: list[RobotEvent] = []
        self.leaders: list[Array] = []
        self._changes = StateChanges(robots)

    @property
    def done(self) -> bool:
        """Whether the robots here have come to their end and stand; never, for those that drive until time is up."""
        return False

    @property
    def ending(self) -> Ending:
        """Where the robots here stand with what they are to do."""
        raise NotImplementedError

    @property
    def leader_paths(self) -> list[Array]:
        """Lines ``(k, 2)`` m of the leaders' ways that are known in this process."""
        raise NotImplementedError

    def step(self, sensed: Observation) -> Array:
        """Return the commands ``(m, 2)`` of the robots here for what they know; m/s and rad/s."""
        raise NotImplementedError

    def step_until_done(self, sensed: Observation) -> Array | None:
        """Do a step, and return None instead of commands once the robots are `done`: a `Controller`."""
        commands = self.step(sensed)
        return None if self.done else commands
