"""One sample of chains of up to a million bodies: time, memory, and pinocchio as far as its memory goes.

    python benchmarks/long.py
    python benchmarks/long.py --n 1000,100000 --format markdown

All contenders of all lengths take turns in one run. Writes results/long.json and draws results/long.png; memory is that
of a process of its own for each length.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter
from measure import Contender, finish, need_kernels, ratio, script_parser, spread, take_turns
from rich.console import Console

import mp2a
from mp2a import Model
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.cores import available_memory
from mp2a.kernels.long import WORTH_IT
from mp2a.plot.looks import FAINT, LOOKS, Look
from mp2a.plot.style import canvas, curve, handle, legends, save_figure, styled
from mp2a.reference import data_bytes
from mp2a.tables import Column, Table, show_plain, show_ratio, show_seconds

OURS = {
    1: Look("mp2a, 1 thread", "#0072B2", "o"),
    2: Look("mp2a, 2 threads", "#000000", "X"),
}
"""Looks by number of threads."""

PINOCCHIO = LOOKS["pinocchio"]._replace(label="pinocchio.rnea")
HELD, ADDED = Look("chain and its state", "#56B4E9", "s"), Look("the call, at its peak", "#D55E00", "D")


def main() -> None:
    """Measure, save, draw and print."""
    parser = script_parser(__doc__, "long.json")
    parser.add_argument("--n", type=numbers, default=[8, 32, 128, 512, 10**3, 10**4, 10**5, 10**6], help="bodies")
    parser.add_argument("--memory", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.memory:
        print(json.dumps(memory(options.memory)))
        return
    need_kernels()
    with Console(stderr=True).status("") as spinner:
        results: dict[str, Any] = {"machine": describe_machine()}
        lengths = results["lengths"] = []
        contenders = {}
        for n in options.n:
            spinner.update(f"n = {n}: memory")
            command = [sys.executable, __file__, "--memory", str(n)]
            held = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            spinner.update(f"n = {n}: chain")
            began = time.perf_counter()
            model = Model.random(n)
            built = time.perf_counter() - began
            state = random_state(n)
            began = time.perf_counter()
            mp2a.rnea(model, *state)
            lengths.append({"n": n, "build": built, "first": time.perf_counter() - began, "memory": held})
            contenders |= ours(model, state) | pinocchio(model, state)
        spinner.update("taking turns")
        results["seconds"] = take_turns(contenders, options.repeats)
    finish(results, tables(results), [], options)
    print(save_figure(figure(results), options.out.with_suffix(".png")))


def random_state(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make one sample; `Model.random_state` would give each body a generator of its own, which takes a minute."""
    rng = np.random.default_rng(0)
    return rng.uniform(-np.pi, np.pi, n), rng.normal(size=n) / np.sqrt(n), rng.normal(size=n) / np.sqrt(n)


def ours(model: Model, state: tuple[np.ndarray, ...]) -> dict[str, Contender]:
    """Make a contender for each number of threads that makes a difference; its "samples" are bodies."""
    q, v, a = state
    out = np.empty(len(model))

    def run(threads: int) -> Contender:
        return Contender(lambda: mp2a.rnea(model, q, v, a, threads=threads, out=out), len(model))

    counts = (1, 2) if len(model) >= WORTH_IT else (1,)
    return {f"{threads} {len(model)}": run(threads) for threads in counts}


def pinocchio(model: Model, state: tuple[np.ndarray, ...]) -> dict[str, Contender]:
    """Make pinocchio's contender where its data fits in a third of the free memory and in a few seconds."""
    free = available_memory()
    if len(model) > 512 or (free is not None and 3 * data_bytes(model.nv) > free):
        return {}
    import pinocchio as pin

    pin_model = model.to_pinocchio()
    data = pin.Data(pin_model)
    return {f"pinocchio {len(model)}": Contender(lambda: pin.rnea(pin_model, data, *state), len(model))}


def memory(n: int) -> dict[str, float]:
    """Measure this process, in bytes: what chain and state hold, and how much a call adds at its peak."""
    small = Model.random(WORTH_IT)
    mp2a.rnea(small, *random_state(len(small)), threads=1)
    del small
    before = resident("VmRSS")
    model, state = Model.random(n), random_state(n)
    held = resident("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    mp2a.rnea(model, *state, threads=1)
    return {"held": held - before, "added": resident("VmHWM") - held}


def resident(what: str) -> int:
    """Read the resident memory of this process, or its peak, in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(what))


def tables(results: dict[str, Any]) -> list[Table]:
    """Make the table of lengths."""
    seconds = results["seconds"]
    last = max((int(name.split()[1]) for name in seconds if name.startswith("pinocchio")), default=None)
    columns = [Column("n"), *(Column(name, show_plain) for name in ("ns a body, 1 thread", "2 threads", "pinocchio"))]
    columns.append(Column("pinocchio at this n, over 1 thread", show_ratio))
    if last:
        columns += [Column(name, show_ratio) for name in (f"pinocchio at {last}, over 1 thread", "over 2 threads")]
    columns += [Column(name, show_seconds, "s") for name in ("first call", "chain made in")]
    columns += [Column(name, "{:.0f}".format) for name in ("bytes a body, chain and state", "call")]
    rows = []
    for length in results["lengths"]:
        n = length["n"]
        one, two, theirs = f"1 {n}", f"2 {n}", f"pinocchio {n}"
        row: list[Any] = [n, *(spread(seconds, name, 1e9) for name in (one, two, theirs)), ratio(seconds, theirs, one)]
        if last:
            row += [ratio(seconds, f"pinocchio {last}", name) for name in (one, two)]
        held = [length["memory"][key] / n if n >= WORTH_IT else None for key in ("held", "added")]
        rows.append([*row, length["first"], length["build"], *held])
    return [Table("one sample of a long chain", columns, rows)]


@styled()
def figure(results: dict[str, Any]) -> Figure:
    """Draw time and memory over the number of bodies."""
    drawn = canvas(7.2, 3.4)
    left, right = drawn.subplots(1, 2)
    for prefix, look in [*((str(threads), look) for threads, look in OURS.items()), ("pinocchio", PINOCCHIO)]:
        points = [
            (int(name.split()[1]), statistics.median(seconds) * int(name.split()[1]))
            for name, seconds in results["seconds"].items()
            if name.split()[0] == prefix
        ]
        if points:
            curve(left, *np.array(points).T, look, gid=prefix)
    lengths = [found for found in results["lengths"] if found["n"] >= WORTH_IT]
    for key, look in (("held", HELD), ("added", ADDED)):
        if lengths:
            curve(right, *np.array([(found["n"], found["memory"][key]) for found in lengths]).T, look, gid=key)
    known = [found["n"] for found in results["lengths"] if f"pinocchio {found['n']}" in results["seconds"]]
    if known:
        theirs = np.array([(n, data_bytes(n)) for n in known if data_bytes(n) > 1e4])
        right.plot(*theirs.T, color=PINOCCHIO.color, linestyle=(0, (4, 2)), gid="pinocchio data")
    largest = max(found["n"] for found in results["lengths"])
    for axes, unit, title in ((left, "s", "time of one sample"), (right, "B", "memory")):
        _log_axes(axes, unit)
        axes.set_title(title)
        _linear(axes, largest)
    groups = [
        ("measured, wall clock", [handle(look) for look in (*OURS.values(), PINOCCHIO)]),
        (
            "memory",
            [handle(HELD), handle(ADDED), handle(Look("pinocchio.Data, 32 n³ bytes", PINOCCHIO.color, ""), "--")],
        ),
        ("for comparison", [handle(Look("linear in n", FAINT, ""), (0, (1, 1.5)))]),
    ]
    legends(drawn, groups)
    return drawn


def _log_axes(axes: Axes, unit: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("number of bodies n")
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_major_formatter(EngFormatter(unit))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", left=False, bottom=False)
    axes.grid(True, which="major")


def _linear(axes: Axes, largest: int) -> None:
    """Draw a line of slope one through the last point of the lowest curve at the largest n."""
    ends = [line.get_ydata()[-1] for line in axes.get_lines() if line.get_xdata()[-1] == largest]
    if ends:
        n = np.array([largest / 1e3, largest])
        axes.plot(n, min(ends) * n / largest, color=FAINT, linestyle=(0, (1, 1.5)), linewidth=1.0, zorder=1)


if __name__ == "__main__":
    main()
