"""What the benchmarks share: contenders that take turns, ratios of turns, the options and the end of a script."""

import argparse
import random
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mp2a import kernels
from mp2a.bench.machine import machine_line
from mp2a.bench.results import write_json
from mp2a.cli.options import add_format
from mp2a.tables import Spread, Table, show

TURN = 5e-3
"""Seconds that a contender's turn takes at least; a turn's time is the median of its calls."""
_MOST_CALLS = 50

Times = dict[str, list[float]]
"""Seconds a sample of each contender, one a repeat."""


class Contender(NamedTuple):
    """What takes turns with others."""

    run: Callable[[], object]
    samples: int = 1
    """How many one call works out."""


def take_turns(contenders: Mapping[str, Contender], repeats: int) -> Times:
    """Time all contenders in turn, in another order each repeat; a turn begins with a call that is not timed.

    Whatever else the machine does slows neighbours in time alike, so that ratios within a repeat hold where times
    do not. What one leaves behind, a cache full of its arrays or threads that still wait for work, meets another each
    time.
    """
    names, rng = list(contenders), random.Random(0)
    calls = {name: _calls(contenders[name].run) for name in names}
    times: Times = {name: [] for name in names}
    for _ in range(repeats):
        for name in rng.sample(names, len(names)):
            run, samples = contenders[name]
            run()
            times[name].append(statistics.median(seconds(run) for _ in range(calls[name])) / samples)
    return times


def ratio(times: Times, slow: str, fast: str) -> Spread | None:
    """Return how many times longer ``slow`` took than ``fast`` in each repeat; None if one of them was not measured."""
    if slow not in times or fast not in times:
        return None
    return Spread.of(a / b for a, b in zip(times[slow], times[fast], strict=True))


def spread(times: Times, name: str, part: float = 1.0) -> Spread | None:
    """Return a part of the times of a contender; None if it was not measured."""
    return Spread.of(part * time for time in times[name]) if name in times else None


def _calls(function: Callable[[], object]) -> int:
    """Count the calls of a turn; the first one, which may compile or take memory, is not timed."""
    function()
    return min(max(1, int(TURN / seconds(function))), _MOST_CALLS)


def seconds(function: Callable[[], object]) -> float:
    """Time one call."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def script_parser(description: str | None, out: str, repeats: int = 9) -> argparse.ArgumentParser:
    """Make a script's parser with the options that all have; ``out`` is the results file's name."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=repeats, help="turns of each contender (default: %(default)s)")
    add_format(parser)
    parser.add_argument("--out", type=Path, default=Path("results") / out, help="results file (default: %(default)s)")
    return parser


def need_kernels() -> None:
    """End the program where there are no compiled kernels."""
    status = kernels.build()
    if not status.compiled:
        sys.exit(f"there are no compiled kernels: {status.why}")


def finish(results: dict[str, Any], tables: Sequence[Table], notes: Sequence[str], options: argparse.Namespace) -> None:
    """Print what was measured, and write it to the results file."""
    show(tables, [*notes, f"Measured on {machine_line(results['machine'])}."], options.format)
    write_json(options.out, results)
