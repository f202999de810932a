"""What the benchmarks share: contenders that take turns, medians of ratios, tables for people and for Markdown."""

import json
import os
import platform
import random
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import mp2a

TURN = 5e-3
"""Seconds that a contender's turn takes at least; a turn's time is the median of its calls."""
_MOST_CALLS = 50

Times = dict[str, list[float]]
"""Seconds a sample of each contender, one a repeat."""


class Contender(NamedTuple):
    """What takes turns with others."""

    run: Callable[[], object]
    samples: int
    """How many one call works out."""


class Table(NamedTuple):
    """Words and figures in columns."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


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


def ratio(times: Times, slow: str, fast: str) -> float:
    """Median over the repeats of how many times longer ``slow`` took than ``fast``."""
    return statistics.median(a / b for a, b in zip(times[slow], times[fast], strict=True))


def _calls(function: Callable[[], object]) -> int:
    """Count the calls of a turn; the first one, which may compile or take memory, is not timed."""
    function()
    return min(max(1, int(TURN / seconds(function))), _MOST_CALLS)


def seconds(function: Callable[[], object]) -> float:
    """Time one call."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def numbers(text: str) -> list[int]:
    """Read whole numbers with commas between them, for argparse."""
    return [int(word) for word in text.split(",")]


def machine() -> dict[str, Any]:
    """Tell what is measured on: processor, versions, and how busy it is."""
    packages = {"mp2a": mp2a.__version__} | {name: version(name) for name in ("numpy", "numba", "pin")}
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {"processor": _processor(), "cores": os.cpu_count(), "python": platform.python_version(), "load": load} | (
        packages
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")


def describe(facts: Mapping[str, Any]) -> str:
    """Write `machine`'s facts in a line."""
    load = "" if facts["load"] is None else f"; load {facts['load']:.1f} when it began"
    versions = ", ".join(f"{name} {facts[name]}" for name in ("python", "mp2a", "numpy", "numba", "pin"))
    return f"{facts['processor']}, {facts['cores']} cores{load}; {versions}"


def show(tables: Sequence[Table], *, markdown: bool) -> None:
    """Print tables, for a page of the documentation or for a terminal."""
    for table in tables:
        if markdown:
            print(f"{table.title}\n\n{as_markdown(table)}\n")
        else:
            _print(table)


def as_markdown(table: Table) -> str:
    """Write a table's headings and rows in Markdown."""
    lines = [table.headings, ["---"] * len(table.headings), *table.rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _print(table: Table) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table as Drawn

    # A pipe has no width to keep to.
    console = Console(width=None if sys.stdout.isatty() else 200)
    drawn = Drawn(title=table.title, box=box.SIMPLE, title_justify="left")
    for k, heading in enumerate(table.headings):
        drawn.add_column(heading, justify="right" if k else "left")
    for row in table.rows:
        drawn.add_row(*row)
    console.print(drawn)


def save(results: Mapping[str, Any], path: Path) -> None:
    """Write results as JSON; the folder is created."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
