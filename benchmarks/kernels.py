"""Time the compiled kernels against numpy's versions: ``python benchmarks/kernels.py``."""

from functools import partial
from typing import Any

import numpy as np
from measure import Contender, finish, need_kernels, ratio, script_parser, spread, take_turns

from mp2a import kernels
from mp2a.bench.machine import describe_machine
from mp2a.tables import Column, Table, show_ratio, show_seconds

COLUMNS = {"compose": (24, 24), "transform": (28, 24), "force": (28, 6, 6), "transform_force": (24, 6)}
SAMPLES = (1, 8, 100, 2000)


def main() -> None:
    """Measure, save and print."""
    options = script_parser(__doc__, "kernels.json", repeats=15).parse_args()
    need_kernels()
    results: dict[str, Any] = {"machine": describe_machine(), "runs": []}
    rng = np.random.default_rng(0)
    for name, columns in COLUMNS.items():
        for samples in SAMPLES:
            inputs = [rng.normal(size=(samples, count)) for count in columns]
            versions = {"numpy": kernels.numpy_version(name), "compiled": getattr(kernels, name)}
            contenders = {version: Contender(partial(function, *inputs)) for version, function in versions.items()}
            seconds = take_turns(contenders, options.repeats)
            results["runs"].append({"kernel": name, "samples": samples, "seconds": seconds})
    finish(results, [table(results["runs"])], [], options)


def table(runs: list[dict[str, Any]]) -> Table:
    """Make the table of a call's time."""
    columns = [
        Column("kernel", left=True),
        Column("T"),
        *(Column(name, show_seconds, "s") for name in ("numpy", "compiled")),
    ]
    columns.append(Column("numpy over compiled", show_ratio))
    rows = []
    for run in runs:
        seconds = run["seconds"]
        times = [spread(seconds, name) for name in ("numpy", "compiled")]
        rows.append([run["kernel"], run["samples"], *times, ratio(seconds, "numpy", "compiled")])
    return Table("time of a call", columns, rows, keys=2)


if __name__ == "__main__":
    main()
