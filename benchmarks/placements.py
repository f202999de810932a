"""Placements of many samples: ours in both layouts beside numpy's, pinocchio's loop, and copying the results.

    python benchmarks/placements.py             # T = 2000 samples, n = 8, 32, 128, 512

pinocchio's loop leaves the placements in C++, a sample over the other. Times are medians of turns in nanoseconds a body
and sample, ratios medians of the ratios of turns that follow each other. Written to results/placements.json.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from measure import Contender, finish, need_kernels, ratio, script_parser, spread, take_turns
from rich.console import Console

import mp2a
from mp2a import Model, Placement
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.reference import need_memory
from mp2a.serial import placements_numpy
from mp2a.tables import Column, Table, show_plain, show_ratio

RATIOS = ("pinocchio, Python loop", "numpy", "copy")
"""What ours is compared with."""

_LOOPED = 64_000
"""Bodies times samples of pinocchio's Python loop, which is measured on some of the samples."""


def main() -> None:
    """Measure, save and print."""
    parser = script_parser(__doc__, "placements.json")
    parser.add_argument("--n", type=numbers, default=[8, 32, 128, 512], help="numbers of bodies")
    parser.add_argument("--samples", type=int, default=2000, help="T (default: 2000)")
    options = parser.parse_args()
    need_kernels()
    results: dict[str, Any] = {"machine": describe_machine(), "samples": options.samples, "runs": []}
    with Console(stderr=True).status("") as spinner:
        for n in options.n:
            spinner.update(f"n = {n}")
            seconds = take_turns(contenders(Model.random(n), options.samples), options.repeats)
            results["runs"].append({"n": n, "seconds": seconds})
    finish(results, tables(results), [], options)


def contenders(model: Model, samples: int) -> dict[str, Contender]:
    """Make the contenders."""
    q = model.random_state(samples)[0]
    columns, out, source = np.asfortranarray(q), mp2a.placements(model, q), mp2a.placements(model, q)
    need_memory(model.nv, copies=1)
    theirs = model.to_pinocchio()
    data, some = theirs.createData(), q[: max(1, min(samples, _LOOPED // len(model)))]

    def loop() -> None:
        for sample in some:
            pin.forwardKinematics(theirs, data, sample)

    calls: dict[str, Callable[[], object]] = {
        "(T, n)": partial(mp2a.placements, model, q, threads=1, out=out),
        "(n, T)": partial(mp2a.placements, model, columns, threads=1, out=out),
        "(T, n), new result": partial(mp2a.placements, model, q, threads=1),
        "numpy": lambda: placements_numpy(model, q),
        "copy": lambda: _copy(out, source),
    }
    return {name: Contender(call, samples) for name, call in calls.items()} | {RATIOS[0]: Contender(loop, len(some))}


def _copy(target: Placement, source: Placement) -> None:
    np.copyto(target.rotation, source.rotation)
    np.copyto(target.translation, source.translation)


def tables(results: dict[str, Any]) -> list[Table]:
    """Make tables of times and of ratios."""
    runs = results["runs"]
    names = list(runs[0]["seconds"])
    rows = [[run["n"], *(spread(run["seconds"], name, 1e9 / run["n"]) for name in names)] for run in runs]
    title = f"ns a body and sample, T = {results['samples']}, one thread"
    times = Table(title, [Column("n"), *(Column(name, show_plain) for name in names)], rows)
    columns = [Column("n"), *(Column(f"{name}, over (T, n)", show_ratio) for name in RATIOS)]
    rows = [[run["n"], *(ratio(run["seconds"], name, "(T, n)") for name in RATIOS)] for run in runs]
    return [times, Table("how many times longer others take", columns, rows)]


if __name__ == "__main__":
    main()
