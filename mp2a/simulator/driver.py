"""What drives simulated robots: the part that a choreography and a march by dynamics share."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.record import FormationRecord, join_records
from mp2a.simulator.events import RobotEvent, StateChanges
from mp2a.simulator.observation import Observation
from mp2a.spatial import Array


class Ending(NamedTuple):
    """What is known of the end of m robots, and what their driver leaves behind."""

    places: Array
    """``(m, 2)``: where they are to be, m in the ground frame."""
    over: NDArray[np.bool_]
    """``(m,)``: whether their leader is through."""
    errors: tuple[str, ...]
    """What brought each into its error state; empty if it is not in it."""
    blocked: NDArray[np.intp]
    """``(m,)``: 1 if a stop signal keeps it from driving forwards, -1 backwards, 0 if none does."""
    leaders: Array
    """``(T, m, 3)``, see `SimulationDriver`."""
    leader_paths: list[Array]
    """Lines ``(k, 2)`` m of the leaders' ways that are known in this process."""
    events: list[RobotEvent]
    """See `SimulationDriver`."""
    record: FormationRecord | None = None
    """Of a march by dynamics."""

    @classmethod
    def of_all(cls, parts: "Sequence[Ending]") -> "Ending":
        """Join the endings of all processes, in the order of the robots."""
        places, over, errors, blocked, leaders, paths, events, records = zip(*parts, strict=True)
        return cls(
            np.concatenate(places), np.concatenate(over), tuple(chain(*errors)), np.concatenate(blocked),
            np.concatenate(leaders, axis=1), paths[0], list(chain(*events)),
            join_records([record for record in records if record is not None]) if records[0] is not None else None,
        )  # fmt: skip


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
        """How it ends for the robots here, as things stand."""
        raise NotImplementedError

    def step(self, sensed: Observation) -> Array:
        """Return the commands ``(m, 2)`` of the robots here for what they know; m/s and rad/s."""
        raise NotImplementedError

    def step_until_done(self, sensed: Observation) -> Array | None:
        """Do a step, and return None instead of commands once the robots are `done`: a `Controller`."""
        commands = self.step(sensed)
        return None if self.done else commands
