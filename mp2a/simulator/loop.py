"""Run a simulation with a controller, and show how far it is."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import positive
from mp2a.exceptions import InputError
from mp2a.simulator.ideal import IdealSimulation
from mp2a.simulator.observation import Observation
from mp2a.simulator.recording import RunRecorder
from mp2a.simulator.simulation import Simulation

MOST_TICKS = 1_000_000
"""A run of more is taken for a mistake: a day of ticks of 0.1 s."""

Controller = Callable[[Observation], ArrayLike | None]
"""What the robots know to commands ``(n, 2)``, m/s and rad/s; None ends the run."""


def simulate(
    simulation: Simulation | IdealSimulation,
    controller: Controller,
    until: float,
    recorder: RunRecorder | None = None,
    *,
    tick: float = 0.1,
    quiet: bool = False,
) -> None:
    """Let a controller drive the robots; on a terminal a bar shows how far it is.

    Parameters
    ----------
    simulation
        The robots.
    controller
        Called once a tick.
    until
        Simulated time at which to end, s; rounded up to whole ticks.
    recorder
        Given each tick, and the last state without commands.
    tick
        s between commands.
    quiet
        Show no bar.

    Raises
    ------
    InputError
        If a time is not positive and finite, or there are more than `MOST_TICKS` ticks.
    """
    from rich.console import Console
    from rich.progress import Progress

    positive("tick", tick)
    start = simulation.time
    ticks = np.ceil((positive("until", until) - start) / tick - 1e-9)
    if ticks > MOST_TICKS:
        raise InputError(f"until: got {until:g} s in ticks of {tick:g} s, expected at most {MOST_TICKS} ticks")
    console = Console(stderr=True)
    with Progress(console=console, disable=quiet or not console.is_terminal, transient=True) as bar:
        task = bar.add_task("simulating", total=until - start)
        for _ in range(int(ticks)):
            sensed = simulation.sense()
            commands = controller(sensed)
            if commands is None:
                break
            if recorder is not None:
                recorder.add(sensed, commands)
            simulation.step(commands, tick)
            bar.update(task, completed=simulation.time - start)
    if recorder is not None:
        recorder.add(simulation.sense(), None)
