"""Whole runs of a choreography, with ideal robots or simulated ones, and what they were."""

from typing import NamedTuple

import numpy as np

from mp2a.checks import positive
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import LONGEST_RUN, TICK
from mp2a.simulator.choreography_driver import ChoreographySimulationDriver
from mp2a.simulator.events import RobotEvent
from mp2a.simulator.ideal import IdealSimulation
from mp2a.simulator.loop import simulate
from mp2a.simulator.observation import Observation
from mp2a.simulator.simulation import Simulation
from mp2a.spatial import Array


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
    events: list[RobotEvent]
    """What robots came into and left, and what they drove into."""
    done: bool
    """Whether the scenario came to its end"""


def run(
    choreography: Choreography,
    longest: float = LONGEST_RUN,
    simulation: IdealSimulation | Simulation | None = None,
    *,
    quiet: bool = True,
) -> ScenarioRun:
    """Run a choreography that has not begun yet to its end.

    Parameters
    ----------
    choreography
        Used up by this.
    longest
        Stop after this time, s.
    simulation
        Of its robots, at their places; None: ideal ones.
    quiet
        Show no bar on a terminal.

    Returns
    -------
    ScenarioRun
        All that happened.
    """
    if simulation is None:
        simulation = IdealSimulation(choreography.models, choreography.slot_poses())
    driver = ChoreographySimulationDriver(choreography)
    rows = []

    def controller(sensed: Observation) -> Array | None:
        commands = driver.step(sensed)
        state, leaders = choreography.state, choreography.state.leaders
        rows.append((
            sensed.time, sensed.poses, sensed.twists, commands, state.raw_command, state.gap_error,
            leaders.pose, leaders.twist, leaders.slot,
        ))  # fmt: skip
        return None if choreography.done else commands

    ticks = int(positive("longest", longest) / TICK) + 1
    simulate(simulation, controller, ticks * TICK, tick=TICK, quiet=quiet)
    columns = (np.array(column) for column in zip(*rows, strict=True))
    return ScenarioRun._make((*columns, [*driver.events, *simulation.collisions], choreography.done))
