"""How much faster than real time the 2-D simulator runs: ``python benchmarks/simulator.py``.

HUSKYs drive abreast or in a line between two walls at a tick of 0.1 s; the table gives simulated over real seconds.
"""

import time

import numpy as np

from mp2a.formation.robot_models import HUSKY
from mp2a.simulator import Simulation, World

SIZES = (2, 8, 64, 512)
SPACING = 2.0
"""m between neighbours."""
TICK = 0.1
BUDGET = 2.0
"""s of real time for each figure."""


def line(n: int) -> np.ndarray:
    """Poses of n robots one behind the other."""
    return np.stack((-SPACING * np.arange(n), np.zeros(n), np.zeros(n)), axis=1)


def square(n: int) -> np.ndarray:
    """Poses of n robots in rows and columns, as near to a square as it goes."""
    rows, columns = np.divmod(np.arange(n), int(np.ceil(np.sqrt(n))))
    return np.stack((-SPACING * rows, SPACING * columns, np.zeros(n)), axis=1)


LAYOUTS = {"line": line, "square": square}


def factor(poses: np.ndarray, sensing: bool) -> float:
    """Measure simulated over real seconds, with or without looking at the LIDAR at every tick."""
    low, high = poses[:, 1].min() - 2, poses[:, 1].max() + 2
    ends = (poses[:, 0].min() - 5, poses[:, 0].max() + 60)
    world = World([[[ends[0], y], [ends[1], y]] for y in (low, high)])
    simulation = Simulation(world, HUSKY, poses)
    commands = np.tile([0.5, 0.0], (len(poses), 1))
    start = time.perf_counter()
    while (spent := time.perf_counter() - start) < BUDGET:
        if sensing:
            simulation.sense()
        simulation.step(commands, TICK)
    return simulation.time / spent


def main() -> None:
    """Print the table."""
    print(
        f"{'robots':>6} " + " ".join(f"{layout + ', ' + what:>20}" for layout in LAYOUTS for what in ("LIDAR", "blind"))
    )
    for n in SIZES:
        figures = [factor(make(n), sensing) for make in LAYOUTS.values() for sensing in (True, False)]
        print(f"{n:>6} " + " ".join(f"{figure:>18.3g} ×" for figure in figures), flush=True)


if __name__ == "__main__":
    main()
