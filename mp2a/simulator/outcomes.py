"""How a simulated run ended, by what its robots know of themselves and by what the simulation shows."""

from collections.abc import Sequence

import numpy as np

from mp2a.formation.outcome import Outcome, outcome
from mp2a.simulator.driver import Ending
from mp2a.simulator.events import SOLID
from mp2a.simulator.simulation import Simulation


def outcomes(simulation: Simulation, roles: Sequence[str], ending: Ending) -> list[Outcome]:
    """Judge how a run ended for each robot.

    Parameters
    ----------
    simulation
        That has been run.
    roles
        Names of its n robots.
    ending
        What all n robots know of their own end.

    Returns
    -------
    list of Outcome
        One a robot.
    """

    def name(number: int | None) -> str:
        return roles[number] if number is not None and number < len(roles) else SOLID

    touched: list[dict[str, None]] = [{} for _ in roles]  # each once, in the order of time
    for event in simulation.collisions:
        touched[event.robot][name(event.other)] = None
        if event.other is not None:
            touched[event.other][roles[event.robot]] = None
    off = np.hypot(*(simulation.poses[:, :2] - ending.places).T)
    out = []
    for i, role in enumerate(roles):
        blocked, direction = "", int(ending.blocked[i])
        if direction:
            thing = simulation.in_the_way(i, direction)
            blocked = "something that its LIDAR saw" if thing is None else name(thing)
        over, error = bool(ending.over[i]), ending.errors[i]
        out.append(outcome(role, float(off[i]), over=over, error=error, blocked=blocked, touched=touched[i]))
    return out
