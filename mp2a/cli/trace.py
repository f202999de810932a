"""``mp2a trace``: record one call with real time stamps."""

import argparse
from pathlib import Path
from typing import Any

from mp2a.cli.options import add_run_options, as_rank, command, positive, progress
from mp2a.exceptions import InputError
from mp2a.mpi_environment import under_mpi


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "trace",
        _trace,
        "Record one call with real time stamps; the file opens in https://ui.perfetto.dev and in mp2a plot timeline.",
        "  mp2a trace --ranks 8 --out results/trace.json\n  mp2a run -n 8 mp2a trace",
    )
    parser.add_argument("--ranks", type=positive, help="number of ranks to start (default: 8)")
    add_run_options(parser)
    parser.add_argument("--method", default="kogge-stone", help="distributed method (default: kogge-stone)")
    parser.add_argument("--out", type=Path, default=Path("results/trace.json"), help="trace file to write")


def _trace(options: argparse.Namespace) -> None:
    from mp2a import files

    if under_mpi():
        if options.ranks is not None:
            raise InputError("--ranks: given under mpirun, expected one or the other")
        trace = as_rank(_trace_here, options)
    else:
        from mp2a.bench.campaign import run_ranks

        files.check_writable(options.out)
        arguments = ["trace", "--samples", options.samples, "--seed", options.seed, "--method", options.method]
        with progress(options.quiet) as say:
            trace = run_ranks([str(word) for word in arguments], options.ranks or 8, say)
    if trace is not None:
        from mp2a.bench.results import write_json

        write_json(options.out, trace)
        if not options.quiet:
            print(options.out)


def _trace_here(options: argparse.Namespace) -> dict[str, Any] | None:
    """Trace as one rank of a running mpirun."""
    from mp2a.bench.timeline import trace_call

    return trace_call(options.samples, options.seed, options.method)
