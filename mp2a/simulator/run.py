"""Run a simulation with a controller, and show how far it is."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import positive
from mp2a.simulator.recording import Recorder
from mp2a.simulator.simulation import Observation, Simulation

Controller = Callable[[Observation], ArrayLike | None]
"""What the robots know to commands ``(n, 2)``, m/s and rad/s; None ends the run."""


def run(
    simulation: Simulation,
    controller: Controller,
    until: float,
    recorder: Recorder | None = None,
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
        Simulated time at which to end, s.
    recorder
        Given each tick, and the last state without commands.
    tick
        s between commands.
    quiet
        Show no bar.
    """
    from rich.console import Console
    from rich.progress import Progress

    positive("tick", tick)
    end = positive("until", until)
    console = Console(stderr=True)
    start = simulation.time
    with Progress(console=console, disable=quiet or not console.is_terminal, transient=True) as bar:
        task = bar.add_task("simulating", total=end - start)
        for _ in range(int(np.ceil((end - start) / tick - 1e-9))):
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
