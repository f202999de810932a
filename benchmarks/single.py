"""One sample a call from Python, ours beside pinocchio's, in one interleaved run.

    python benchmarks/single.py                          # random arms of 7 and 32 joints
    python benchmarks/single.py --urdf panda.urdf        # and a robot

pinocchio fills arrays that its Data holds; so do we with ``out=``, and without we return new ones. Its placements are
left in C++; "read" takes them to numpy as well, where ours are. Times are medians of turns, ratios medians of the
ratios of turns that follow each other. Everything is written to results/single.json.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from measure import Contender, finish, need_kernels, ratio, script_parser, spread, take_turns
from rich.console import Console

import mp2a
from mp2a import Model
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.tables import Column, Table, show_plain, show_ratio

CALLS = 100
"""Calls of a contender that are timed together."""

RATIOS = (("rnea", "rnea: pinocchio"), ("rnea, out=", "rnea: pinocchio"), ("placements", "placements: pinocchio"),
          ("placements, out=", "placements: pinocchio"), ("placements", "placements: pinocchio, read"))  # fmt: skip
"""Ours, and what it is compared with."""


def main() -> None:
    """Measure, save and print."""
    parser = script_parser(__doc__, "single.json", repeats=25)
    parser.add_argument("--n", type=numbers, default=[7, 32], help="numbers of joints")
    parser.add_argument("--urdf", type=Path, help="a robot as well, such as a Panda")
    options = parser.parse_args()
    need_kernels()
    models = {f"{n} joints": Model.random(n) for n in options.n}
    if options.urdf:
        models[options.urdf.stem] = Model.from_urdf(options.urdf)
    results: dict[str, Any] = {"machine": describe_machine(), "runs": []}
    with Console(stderr=True).status("") as spinner:
        for name, model in models.items():
            spinner.update(name)
            contenders = {key: Contender(partial(_repeat, call), CALLS) for key, call in calls(model).items()}
            seconds = take_turns(contenders, options.repeats)
            results["runs"].append({"model": name, "n": len(model), "seconds": seconds})
    finish(results, tables(results["runs"]), [], options)


def _repeat(call: Callable[[], object]) -> None:
    for _ in range(CALLS):
        call()


def calls(model: Model) -> dict[str, Callable[[], object]]:
    """Make the calls that are compared, and see that they agree."""
    q, v, a = model.random_state()
    torque, placement = mp2a.rnea(model, q, v, a), mp2a.placements(model, q)
    theirs = model.to_pinocchio()
    data = theirs.createData()

    def read() -> tuple[np.ndarray, np.ndarray]:
        pin.forwardKinematics(theirs, data, q)
        places = [data.oMi[i] for i in range(1, theirs.njoints)]
        return np.array([x.rotation for x in places]), np.array([x.translation for x in places])

    np.testing.assert_allclose(pin.rnea(theirs, data, q, v, a), torque, rtol=0, atol=1e-9 * abs(torque).max())
    for got, wanted in zip(read(), placement, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-9)
    return {
        "rnea": lambda: mp2a.rnea(model, q, v, a),
        "rnea, out=": lambda: mp2a.rnea(model, q, v, a, out=torque),
        "rnea: pinocchio": lambda: pin.rnea(theirs, data, q, v, a),
        "placements": lambda: mp2a.placements(model, q),
        "placements, out=": lambda: mp2a.placements(model, q, out=placement),
        "placements: pinocchio": lambda: pin.forwardKinematics(theirs, data, q),
        "placements: pinocchio, read": read,
    }


def tables(runs: list[dict[str, Any]]) -> list[Table]:
    """Make tables of times and of ratios."""
    names = list(runs[0]["seconds"])
    times = [Column("model", left=True), *(Column(name, show_plain) for name in names)]
    rows = [[run["model"], *(spread(run["seconds"], name, 1e6) for name in names)] for run in runs]
    columns = [Column("model", left=True)]
    columns += [Column(f"{ours}, of {theirs.partition(': ')[2]}", show_ratio) for ours, theirs in RATIOS]
    ratios = [[run["model"], *(ratio(run["seconds"], *pair) for pair in RATIOS)] for run in runs]
    return [Table("µs a call", times, rows), Table("how many times as long ours takes", columns, ratios)]


if __name__ == "__main__":
    main()
