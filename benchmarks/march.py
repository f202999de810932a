"""How many robots one process marches in real time at 10 Hz: ``python benchmarks/march.py``.

Every tick is timed: sensing in a small world excluded, the march of all robots included. The largest formation whose
slowest ticks (99th percentile) stay below 0.1 s is found by doubling and bisection.
"""

import argparse
import time

import numpy as np

from mp2a import kernels
from mp2a.formation import Discs, Formation, FormationController, LocalExchange, waypoints

TICK = 0.1
PATH = waypoints([[0, 0], [40, 0], [40, 40], [120, 60]], 5.0)


def ticks(robots: int, shape: str, method: str, count: int) -> np.ndarray:
    """Time ``count`` ticks after as many of warming up, s."""
    rng = np.random.default_rng(0)
    reach = 2.0 * robots if shape == "line" else 2.0 * np.sqrt(robots)
    world = Discs(np.column_stack((rng.uniform(-reach, 20, 30), rng.uniform(-3, 3, 30), np.full(30, 0.3))))
    formation = Formation.of(shape, robots)
    march = FormationController(formation, PATH, LocalExchange(formation.model, method))
    times = []
    for _ in range(2 * count):
        sensed = world.sense(march.state.pose)
        start = time.perf_counter()
        march.step(sensed)
        times.append(time.perf_counter() - start)
    return np.array(times[count:])


def row(robots: int, shape: str, method: str, count: int) -> bool:
    """Print a row of the table; returns whether the formation keeps up."""
    times = ticks(robots, shape, method, count)
    middle, slow = np.median(times), np.percentile(times, 99)
    print(
        f"{shape:9} {method:12} {robots:8} {1e3 * middle:9.2f} ms {1e3 * slow:9.2f} ms {TICK / middle:8.1f}", flush=True
    )
    return bool(slow < TICK)


def largest(shape: str, method: str, count: int) -> int:
    """Largest number of robots in real time, to a tenth."""
    fits, over = 512, 0
    while not over:
        if row(2 * fits, shape, method, count):
            fits *= 2
        else:
            over = 2 * fits
    while over > 1.1 * fits:
        middle = (fits + over) // 2
        if row(middle, shape, method, count):
            fits = middle
        else:
            over = middle
    return fits


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50, help="ticks to time of each formation (default: 50)")
    parser.add_argument("--methods", default="sweep,compact", help="methods (default: sweep,compact)")
    options = parser.parse_args()
    kernels.build()
    print(f"{'shape':9} {'method':12} {'robots':>8} {'median':>12} {'99 %':>12} {'× real time':>8}")
    for shape in ("line", "triangle"):
        for method in options.methods.split(","):
            for robots in (8, 64, 512):
                row(robots, shape, method, options.count)
            found = largest(shape, method, options.count)
            print(f"{shape}, {method}: {found} robots in real time at 10 Hz, one process")


if __name__ == "__main__":
    main()
