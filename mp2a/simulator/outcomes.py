"""How a simulated run ended, by what its robots know of themselves and by what the simulation shows."""

from collections.abc import Sequence

import numpy as np

from mp2a.formation.outcome import Outcome, outcome
from mp2a.simulator.driver import Ending
from mp2a.simulator.events import SOLID
from mp2a.simulator.ideal import IdealSimulation
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
    hit = touched(simulation, roles)
    off = np.hypot(*(simulation.poses[:, :2] - ending.places).T)
    out = []
    for i, role in enumerate(roles):
        blocked, direction = "", int(ending.blocked[i])
        if direction:
            thing = simulation.in_the_way(i, direction)
            blocked = "something that its LIDAR saw" if thing is None else (*roles, SOLID)[min(thing, len(roles))]
        over, error = bool(ending.over[i]), ending.errors[i]
        out.append(outcome(role, float(off[i]), over=over, error=error, blocked=blocked, touched=hit[role]))
    return out


def touched(simulation: Simulation | IdealSimulation, roles: Sequence[str]) -> dict[str, list[str]]:
    """Return what each robot has driven into, or what into it: each once, in the order of time."""
    out: dict[str, list[str]] = {role: [] for role in roles}
    for event in simulation.collisions:
        first, second = roles[event.robot], SOLID if event.other is None else roles[event.other]
        for one, other in ((first, second), (second, first)):
            if one in out and other not in out[one]:
                out[one].append(other)
    return out
