"""``mp2a bench``: time the methods and their baselines."""

import argparse
from pathlib import Path
from typing import Any

from mp2a.bench.contenders import FAMILIES
from mp2a.bench.settings import BenchSettings
from mp2a.cli.options import (
    add_format,
    add_network,
    add_run_options,
    as_rank,
    command,
    network,
    positive,
    positive_number,
    progress,
    ranks,
    say_line,
    words,
)
from mp2a.exceptions import InputError
from mp2a.mpi_environment import under_mpi


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "bench",
        _bench,
        "Time inverse dynamics of a formation, one rank a robot, against MPI_Scan, pipeline, gather-scatter and "
        "what one process takes.",
        "  mp2a bench --ranks 1,2,4,8                start mpirun for each number of ranks\n"
        "  mp2a bench --ranks 1,2,4,8 --resume       go on after Ctrl-C\n"
        "  mp2a run -n 8 mp2a bench                  measure on the ranks that are there\n"
        "  mp2a bench --ranks 8,64 --samples 1 --network 5ms,54Mbit --out results/radio.json\n"
        "  mp2a bench --ranks 1,2 --bodies 100000    strong scaling: blocks of one long chain; see mp2a plot scaling\n"
        "  mp2a bench --ranks 1,2 --bodies-per-rank 50000     weak scaling\n"
        "  mp2a bench --compare old.json new.json    how many times as long each contender takes in new.json",
    )
    parser.add_argument("--ranks", type=ranks, metavar="N,N,…", help="numbers of ranks to start (default: 1,2,4,8)")
    add_run_options(parser, samples=None, explained="2000; 1 for chains in blocks")
    defaults = BenchSettings()
    parser.add_argument("--methods", type=words, default=defaults.methods, help="methods to measure (default: all)")
    parser.add_argument(
        "--baselines",
        type=words,
        default=defaults.baselines,
        help=f"whom to measure them against: some of {','.join(FAMILIES)} (default: all)",
    )
    chain = parser.add_mutually_exclusive_group()
    chain.add_argument("--bodies", type=positive, metavar="N", help="bodies of a long chain, cut into a block a rank")
    chain.add_argument("--bodies-per-rank", type=positive, metavar="N", help="bodies of each rank (default: 1)")
    parser.add_argument(
        "--network", type=network, metavar="LATENCY,BANDWIDTH", help="network to emulate, such as 5ms,54Mbit"
    )
    parser.add_argument(
        "--repeats", type=positive, default=defaults.repeats, help="repeats of each contender (default: %(default)s)"
    )
    parser.add_argument(
        "--seconds", type=positive_number, default=defaults.seconds,
        help="time for the repeats of all contenders (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("results/bench.json"), help="results file to append to")
    parser.add_argument(
        "--resume", action="store_true",
        help="leave out what the results file holds already of the same settings and processor",
    )  # fmt: skip
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("A", "B"), help="compare two results files instead")
    add_format(parser)
    add_network(parser)


def _bench(options: argparse.Namespace) -> None:
    from mp2a.bench import results

    if options.compare:
        _compare(options)
        return
    if options.out.is_file():
        results.load(options.out)  # said now if it cannot be appended to, not after the measurement
    if under_mpi():
        _bench_here(options)
        return
    from mp2a.bench.campaign import run_campaign

    with progress(options.quiet) as say:
        runs = run_campaign(
            options.ranks or [1, 2, 4, 8], _settings(options), options.out, resume=options.resume, say=say
        )
    _show(runs, options)


def _bench_here(options: argparse.Namespace) -> None:
    """Measure as one rank of a running mpirun."""
    for name in ("ranks", "resume"):
        if getattr(options, name):
            raise InputError(f"--{name}: given under mpirun, expected one or the other")
    from mp2a.bench import results

    run = as_rank(_measure, options)
    if run is not None:
        results.append(options.out, run)
        if not options.quiet:
            _show([run], options)


def _measure(options: argparse.Namespace) -> dict[str, Any] | None:
    from mp2a import files
    from mp2a.bench.rank import measure_run
    from mp2a.exceptions import OutputError
    from mp2a.mpi import MPI

    error = None
    if MPI.COMM_WORLD.Get_rank() == 0:
        try:
            files.check_writable(options.out)
        except OutputError as caught:
            error = f"--out: {caught}"
    error = MPI.COMM_WORLD.bcast(error)
    if error:
        raise InputError(error)
    return measure_run(_settings(options), say_line if options.quiet else lambda what: None)


def _compare(options: argparse.Namespace) -> None:
    if options.ranks or options.resume:
        raise InputError("--compare: given with --ranks or --resume, expected it to be the only thing to do")
    from mp2a.bench import results
    from mp2a.bench.report import comparison
    from mp2a.tables import show

    before, after = (results.load(path)["runs"] for path in options.compare)
    table, notes = comparison(before, after)
    show([table], [f"A is {options.compare[0]}, B is {options.compare[1]}.", *notes], options.format)


def _show(runs: list[dict[str, Any]], options: argparse.Namespace) -> None:
    from mp2a.bench.findings import findings
    from mp2a.bench.report import bench_notes, bench_tables, latest
    from mp2a.tables import show

    runs = latest(runs)
    notes = [*findings(runs), *bench_notes(runs), f"Kept in {options.out}."]
    show(bench_tables(runs), notes, options.format)


def _settings(options: argparse.Namespace) -> BenchSettings:
    settings = BenchSettings(*(getattr(options, name) for name in BenchSettings._fields))
    if options.samples is None:
        blocks = options.bodies or options.bodies_per_rank
        settings = settings._replace(samples=1 if blocks else BenchSettings().samples)
    if unknown := [name for name in settings.baselines if name not in FAMILIES]:
        raise InputError(f"--baselines: got {','.join(unknown)}, expected some of {','.join(FAMILIES)}")
    most = max(options.ranks or [1])
    if options.bodies and options.bodies < most:
        raise InputError(f"--bodies: got {options.bodies}, expected at least the {most} of --ranks")
    return settings
