"""Many samples with ``threads=None`` beside one thread and two, on a machine that is quiet and on one that is busy.

    python benchmarks/busy.py                   # T = 2000 samples, n = 8, 32, 128; 0, 1 and 2 busy neighbours

A neighbour is a process that counts, which the system puts on some core. Contenders take turns, in another order each
time, until each has had its seconds. Medians tell how long a call takes, means what a program waits for in all: a call
that has to wait for a thread that is not running waits for some milliseconds. Written to results/busy.json.
"""

import multiprocessing
import os
import random
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from measure import finish, need_kernels, script_parser
from measure import seconds as time_of
from rich.console import Console

import mp2a
from mp2a import Model
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.tables import Column, Spread, Table, show_plain, show_ratio

CONTENDERS: dict[str, int | None] = {"threads=1": 1, "threads=2": 2, "threads=None": None}
TURN = 20e-3
"""Seconds of a contender's turn. Its first calls are timed as well: what is measured is also how fast it adapts."""


def main() -> None:
    """Measure, save and print."""
    parser = script_parser(__doc__, "busy.json", repeats=25)
    parser.add_argument("--n", type=numbers, default=[8, 32, 128], help="numbers of bodies")
    parser.add_argument("--samples", type=int, default=2000, help="T (default: 2000)")
    parser.add_argument("--neighbours", type=int, nargs="+", default=[0, 1, 2], help="numbers of busy processes")
    options = parser.parse_args()
    need_kernels()
    results: dict[str, Any] = {"machine": describe_machine(), "samples": options.samples, "runs": []}
    with Console(stderr=True).status("") as spinner:
        for n in options.n:
            for count in options.neighbours:
                spinner.update(f"n = {n}, {count} neighbours")
                with neighbours(count):
                    turns = take_turns(n, options.samples, options.repeats)
                results["runs"].append({"n": n, "neighbours": count, "seconds": turns})
    finish(results, tables(results), [], options)


@contextmanager
def neighbours(count: int) -> Iterator[None]:
    """Have busy processes beside this one."""
    processes = [
        multiprocessing.get_context("spawn").Process(target=_be_busy, args=(os.getpid(),)) for _ in range(count)
    ]
    for process in processes:
        process.start()
    time.sleep(1.0 if count else 0.0)  # until they have started
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def _be_busy(parent: int) -> None:
    while os.getppid() == parent:
        for _ in range(100_000):
            pass


def take_turns(n: int, samples: int, repeats: int) -> dict[str, list[list[float]]]:
    """Return the seconds of all calls of each contender, a list a turn."""
    model = Model.random(n)
    state, out = model.random_state(samples), np.empty((samples, model.nv))
    turns: dict[str, list[list[float]]] = {name: [] for name in CONTENDERS}
    rng = random.Random(0)
    for _ in range(repeats):
        for name in rng.sample(list(CONTENDERS), len(CONTENDERS)):
            call = partial(mp2a.rnea, model, *state, threads=CONTENDERS[name], out=out)
            calls: list[float] = []
            while sum(calls) < TURN:
                calls.append(time_of(call))
            turns[name].append(calls)
    return turns


def tables(results: dict[str, Any]) -> list[Table]:
    """Make tables of medians and of means."""
    made = []
    for what, of_turn in (("median", statistics.median), ("mean", statistics.fmean)):
        columns = [Column("n"), Column("neighbours")]
        columns += [Column(f"{name}, µs", show_plain) for name in CONTENDERS]
        columns += [Column(f"{name}, of threads=1", show_ratio) for name in ("threads=2", "threads=None")]
        rows = []
        for run in results["runs"]:
            turns = {name: [of_turn(calls) for calls in each] for name, each in run["seconds"].items()}
            times = [Spread.of(1e6 * x for x in turns[name]) for name in CONTENDERS]
            ratios = [
                Spread.of(a / b for a, b in zip(turns[name], turns["threads=1"], strict=True))
                for name in ("threads=2", "threads=None")
            ]
            rows.append([run["n"], run["neighbours"], *times, *ratios])
        made.append(Table(f"a call of T = {results['samples']} samples, {what}", columns, rows, keys=2))
    return made


if __name__ == "__main__":
    main()
