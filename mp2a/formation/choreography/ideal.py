"""Ideal robots: they do exactly what they are told, within their limits of speed and acceleration.

Nothing slips, nothing is in the way, poses are known. `mp2a check` runs a scenario with them.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography.constants import TICK
from mp2a.formation.choreography.places import arc, compose
from mp2a.formation.choreography.runner import Choreography, Fleet
from mp2a.spatial import Array


class Run(NamedTuple):
    """What n ideal robots did at T ticks.

    Attributes
    ----------
    time
        ``(T,)`` s.
    poses, twists
        ``(T, n, 3)`` and ``(T, n, 2)`` of the robots.
    commands, asked
        ``(T, n, 2)``: what they were told, and what the controller asked for before any limit.
    excess
        ``(T, n)`` m: how much farther than asked each was from its leader.
    leader_poses, leader_twists, places
        ``(T, n, 3)``, ``(T, n, 2)`` and ``(T, n, 2)`` of the virtual leaders.
    done
        Whether the scenario came to its end.
    """

    time: Array
    poses: Array
    twists: Array
    commands: Array
    asked: Array
    excess: Array
    leader_poses: Array
    leader_twists: Array
    places: Array
    done: bool


def drive(fleet: Fleet, poses: Array, twists: Array, commands: Array, dt: float = TICK) -> tuple[Array, Array]:
    """Poses ``(n, 3)`` and twists ``(n, 2)`` after ``dt`` s: speeds go to the commands as fast as the limits allow."""
    limits = np.column_stack((fleet.max_speed, fleet.max_turn_rate))
    change = np.column_stack((fleet.max_acceleration, fleet.max_turn_acceleration)) * dt
    reached = twists + np.clip(np.clip(commands, -limits, limits) - twists, -change, change)
    return compose(poses, arc(reached, dt)), reached


def run(choreography: Choreography, longest: float = 3600.0, tell: Callable[[float], None] | None = None) -> Run:
    """Run a choreography that has not begun yet to its end, with ideal robots that start in place.

    Parameters
    ----------
    choreography
        Used up by this.
    longest
        Stop after this time, s.
    tell
        Called with the time, s, every ten seconds of it.

    Returns
    -------
    Run
        All that happened.
    """
    if not 0 < longest < np.inf:
        raise InputError(f"longest: got {longest}, expected a positive number of seconds")
    poses = choreography.places()
    twists = np.zeros((len(poses), 2))
    records = []
    for tick in range(int(longest / TICK) + 1):
        time = tick * TICK
        commands = choreography.step(time, poses, twists, None)
        state = choreography.state
        leaders = state.leaders
        records.append((
            time, poses, twists, commands, state.asked, state.excess, leaders.pose, leaders.twist, leaders.place
        ))  # fmt: skip
        if choreography.done:
            break
        if tell is not None and tick % 100 == 0:
            tell(time)
        poses, twists = drive(choreography.fleet, poses, twists, commands)
    columns = [np.array(column) for column in zip(*records, strict=True)]
    return Run._make([*columns, choreography.done])
