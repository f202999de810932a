"""Our methods beside MPI's own scan, in both of Open MPI's algorithms: one run for each number of ranks.

    python benchmarks/mpi_scan.py --ranks 2,8,64

All take turns within a run; a time is the wall clock of the slowest rank. Appends to results/mpi_scan.json. Of each
repeat the time of our best method is divided by that of the better ``MPI_Scan``, by their medians.
"""

import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from measure import script_parser

from mp2a.bench.campaign import run_campaign
from mp2a.bench.contenders import MPI_SCAN, family
from mp2a.bench.machine import machine_line
from mp2a.bench.settings import BenchSettings
from mp2a.cli.options import progress, ranks
from mp2a.tables import Column, Spread, Table, show, show_ratio, show_seconds

Run = Mapping[str, Any]


def main() -> None:
    """Run and print."""
    parser = script_parser(__doc__, "mpi_scan.json", repeats=15)
    parser.add_argument("--ranks", type=ranks, default=[2, 8, 64], help="numbers of robots (default: 2,8,64)")
    parser.add_argument("--samples", type=int, default=2000, help="samples in a message, beside one (default: 2000)")
    parser.add_argument("--seconds", type=float, default=10.0, help="for the repeats of all contenders")
    options = parser.parse_args()
    settings = BenchSettings(options.samples, options.repeats, baselines=(MPI_SCAN,), seconds=options.seconds)
    with progress(quiet=False) as say:
        runs = run_campaign(options.ranks, settings, options.out, resume=False, say=say)
    missing = dict.fromkeys(reason for run in runs for reason in run["missing"])
    show([table(runs)], [*missing, f"Measured on {machine_line(runs[-1]['machine'])}."], options.format)


def table(runs: Sequence[Run]) -> Table:
    """Make the table of times a sample, and of how many times as long as MPI_Scan ours takes."""
    names = dict.fromkeys(name for run in runs for name in run["measured"])
    columns = [Column("n"), Column("samples"), *(Column(name, _median, "s") for name in names)]
    rows = []
    for run in runs:
        for size, samples in (("single", 1), ("batch", run["samples"])):
            walls = {name: sizes[size]["walls"] for name, sizes in run["measured"].items() if size in sizes}
            if walls:
                times = [Spread.of(walls[name]) if name in walls else None for name in names]
                rows.append([run["n"], samples, *times, _ratio(walls)])
    return Table("time a sample", [*columns, Column("ours over MPI_Scan", show_ratio)], rows, keys=2)


def _median(spread: Spread) -> str:
    return show_seconds(spread.median)


def _ratio(walls: Mapping[str, Sequence[float]]) -> Spread | None:
    """Return the times of the best of ours over those of the better scan, repeat by repeat."""
    scans = [times for name, times in walls.items() if family(name) == MPI_SCAN]
    ours = [times for name, times in walls.items() if family(name) != MPI_SCAN]
    if not scans:
        return None
    best, better = min(ours, key=statistics.median), min(scans, key=statistics.median)
    return Spread.of(a / b for a, b in zip(best, better, strict=True))


if __name__ == "__main__":
    main()
