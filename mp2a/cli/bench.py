"""``mp2a bench``: time the methods and their opponents."""

import argparse
from pathlib import Path
from typing import Any

from mp2a.bench.settings import Settings
from mp2a.cli.options import (
    WIDTH,
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
        "Time inverse dynamics of a formation, one rank a robot, against relay, centre and pinocchio.",
        "  mp2a bench --ranks 1,2,4,8                start mpirun for each number of ranks\n"
        "  mp2a run -n 8 mp2a bench                  measure on the ranks that are there\n"
        "  mp2a bench --ranks 8,64 --samples 1 --network 5ms,54Mbit --out results/radio.json",
    )
    parser.add_argument("--ranks", type=ranks, metavar="N,N,…", help="numbers of ranks to start (default: 1,2,4,8)")
    add_run_options(parser)
    parser.add_argument("--methods", type=words, default=Settings().methods, help="methods to measure (default: all)")
    parser.add_argument(
        "--network", type=network, metavar="LATENCY,BANDWIDTH", help="network to emulate, such as 5ms,54Mbit"
    )
    parser.add_argument("--repeats", type=positive, default=5, help="repeats of each contender (default: 5)")
    parser.add_argument(
        "--seconds", type=positive_number, default=10.0, help="time for the repeats of all contenders (default: 10)"
    )
    parser.add_argument("--out", type=Path, default=Path("results/bench.json"), help="results file to append to")
    parser.add_argument("--fresh", action="store_true", help="measure again what the results file holds already")
    add_network(parser)


def _bench(options: argparse.Namespace) -> None:
    from mp2a.bench import results

    if options.out.exists():
        results.load(options.out)  # said now if it cannot be appended to, not after the measurement
    if under_mpi():
        if options.ranks is not None:
            raise InputError("--ranks: given under mpirun, expected one or the other")
        as_rank(_bench_here, options)
        return
    from mp2a.bench.sweep import sweep

    with progress(options.quiet) as say:
        runs = sweep(options.ranks or [1, 2, 4, 8], _settings(options), options.out, fresh=options.fresh, say=say)
    _show(runs, options.out)


def _bench_here(options: argparse.Namespace) -> None:
    """Measure as one rank of a running mpirun."""
    from mp2a.bench import results
    from mp2a.bench.rank import run

    done = run(_settings(options), say_line if options.quiet else lambda what: None)
    if done is None:
        return
    results.append(options.out, done)
    if not options.quiet:
        _show([done], options.out)


def _show(runs: list[dict[str, Any]], path: Path) -> None:
    from rich.console import Console

    from mp2a.bench.table import beyond, messages, notes, times

    console = Console(width=WIDTH)
    console.print(messages(runs))
    for size in ("batch", "single") if runs[-1]["samples"] > 1 else ("single",):
        console.print(times(runs, size))
        console.print(beyond(runs, size))
    for note in notes(runs):
        console.print(note, highlight=False)
    console.print(f"kept in {path}", highlight=False)


def _settings(options: argparse.Namespace) -> Settings:
    return Settings(*(getattr(options, name) for name in Settings._fields))
