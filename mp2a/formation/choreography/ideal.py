"""Runs of a choreography, with ideal robots: they do exactly what they are told, within their limits.

Nothing slips, nothing is in the way, poses are known. `mp2a check` runs a scenario with them.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from mp2a.checks import positive
from mp2a.formation.choreography.fleet import Fleet
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import LONGEST_RUN, TICK
from mp2a.se2 import compose, drive
from mp2a.spatial import Array

_TELL = 100
"""Ticks between two times at which a run says how far it is."""


class ScenarioRun(NamedTuple):
    """What n robots did at T ticks."""

    time: Array
    """``(T,)`` s"""
    poses: Array
    """``(T, n, 3)`` of the robots"""
    twists: Array
    """``(T, n, 2)`` of the robots"""
    commands: Array
    """``(T, n, 2)``: what they were sent"""
    raw_commands: Array
    """``(T, n, 2)``: what the controller wanted before any limit"""
    gap_errors: Array
    """``(T, n)`` m: how much farther than wanted each was from its leader"""
    leader_poses: Array
    """``(T, n, 3)`` of the virtual leaders"""
    leader_twists: Array
    """``(T, n, 2)`` of the virtual leaders"""
    slots: Array
    """``(T, n, 2)``: where each was to be, seen from its leader, m"""
    done: bool
    """Whether the scenario came to its end"""


class Robots(Protocol):
    """Those who run a choreography."""

    @property
    def done(self) -> bool:
        """Whether they have come to the end."""
        ...

    def decide(self) -> tuple[float, Array, Array, Array]:
        """Step the choreography; returns time, poses, twists and commands."""
        ...

    def move(self, commands: Array) -> None:
        """Drive for a tick."""
        ...


class IdealRobots:
    """Ideal robots that start in place."""

    def __init__(self, choreography: Choreography) -> None:
        self._choreography = choreography
        self._tick, self._poses = 0, choreography.slot_poses()
        self._twists = np.zeros((len(self._poses), 2))

    @property
    def done(self) -> bool:
        """Whether they have come to the end."""
        return self._choreography.done

    def decide(self) -> tuple[float, Array, Array, Array]:
        """Step the choreography; returns time, poses, twists and commands."""
        time = self._tick * TICK
        return time, self._poses, self._twists, self._choreography.step(time, self._poses, self._twists, None)

    def move(self, commands: Array) -> None:
        """Drive for a tick."""
        self._poses, self._twists = obey(self._choreography.fleet, self._poses, self._twists, commands)
        self._tick += 1


def obey(fleet: Fleet, poses: Array, twists: Array, commands: Array, dt: float = TICK) -> tuple[Array, Array]:
    """Return poses ``(n, 3)`` and twists ``(n, 2)`` after ``dt`` s: speeds follow commands as limits allow."""
    change = np.column_stack((fleet.max_acceleration, fleet.max_turn_acceleration)) * dt
    wanted = np.clip(commands, -fleet.fastest, fleet.fastest)
    reached = twists + np.clip(wanted - twists, -change, change)
    return compose(poses, drive(reached, dt)), reached


def run(
    choreography: Choreography,
    longest: float = LONGEST_RUN,
    tell: Callable[[float], None] | None = None,
    robots: Robots | None = None,
) -> ScenarioRun:
    """Run a choreography that has not begun yet to its end.

    Parameters
    ----------
    choreography
        Used up by this.
    longest
        Stop after this time, s.
    tell
        Called with the time, s, every ten seconds of it.
    robots
        Who runs it; None: `IdealRobots`.

    Returns
    -------
    ScenarioRun
        All that happened.
    """
    positive("longest", longest)
    robots = robots or IdealRobots(choreography)
    rows = []
    for tick in range(int(longest / TICK) + 1):
        time, poses, twists, commands = robots.decide()
        state, leaders = choreography.state, choreography.state.leaders
        rows.append((
            time, poses, twists, commands, state.raw_command, state.gap_error,
            leaders.pose, leaders.twist, leaders.slot,
        ))  # fmt: skip
        if robots.done:
            break
        if tell is not None and tick % _TELL == 0:
            tell(time)
        robots.move(commands)
    return ScenarioRun._make([*(np.array(column) for column in zip(*rows, strict=True)), robots.done])
