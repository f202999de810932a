"""Time the compiled kernels against numpy's versions: ``python benchmarks/kernels.py``.

Machines are noisy, so the two take turns, and the table gives the medians of both and of their ratio.
"""

import statistics
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from mp2a import kernels

COLUMNS = {"compose": (24, 24), "transform": (28, 24), "force": (28, 6, 6), "transform_force": (24, 6)}
SAMPLES = (1, 8, 100, 2000)
ROUNDS = 15
ROUND_TIME = 5e-3
"""Seconds that one side's turn takes."""


def seconds(function: Callable[..., object], inputs: Sequence[np.ndarray], calls: int) -> float:
    """Time one call, in s, as the mean of several."""
    start = time.perf_counter()
    for _ in range(calls):
        function(*inputs)
    return (time.perf_counter() - start) / calls


def turns(functions: Sequence[Callable[..., object]], inputs: Sequence[np.ndarray]) -> list[list[float]]:
    """Time functions in turn, ``ROUNDS`` times: seconds a call, for each function."""
    calls = [max(1, int(ROUND_TIME / seconds(function, inputs, 3))) for function in functions]
    plan = list(zip(functions, calls, strict=True))
    rounds = [[seconds(function, inputs, count) for function, count in plan] for _ in range(ROUNDS)]
    return [list(column) for column in zip(*rounds, strict=True)]


def main() -> None:
    """Print the table."""
    status = kernels.build()
    if not status.compiled:
        sys.exit(f"there are no compiled kernels: {status.why}")
    rng = np.random.default_rng(0)
    print(f"{'':8} {'T':>5} {'numpy':>12} {'compiled':>12} {'ratio':>7}")
    for name, columns in COLUMNS.items():
        for samples in SAMPLES:
            inputs = [rng.normal(size=(samples, count)) for count in columns]
            slow, fast = turns((kernels.numpy_version(name), getattr(kernels, name)), inputs)
            ratio = statistics.median(a / b for a, b in zip(slow, fast, strict=True))
            medians = (1e6 * statistics.median(times) for times in (slow, fast))
            print(f"{name:8} {samples:5} " + " ".join(f"{median:9.2f} µs" for median in medians) + f" {ratio:7.1f}")


if __name__ == "__main__":
    main()
