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
        "Record one call with real time stamps, and print where its time goes; the file opens in "
        "https://ui.perfetto.dev and in mp2a plot timeline, as OTF2 in the tools of HPC (Vampir, Scalasca).",
        "  mp2a trace --ranks 8 --out results/trace.json\n"
        "  mp2a run -n 8 mp2a trace\n"
        "  mp2a trace --ranks 8 --format otf2          an archive in results/trace",
    )
    parser.add_argument("--ranks", type=positive, help="number of ranks to start (default: 8)")
    add_run_options(parser)
    parser.add_argument("--method", default="kogge-stone", help="distributed method (default: kogge-stone)")
    parser.add_argument(
        "--format", choices=("json", "otf2"), default="json", help="of the trace (default: %(default)s)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="file to write, or folder of an OTF2 archive (default: results/trace.json, results/trace)",
    )


def _trace(options: argparse.Namespace) -> None:
    as_otf2 = options.format == "otf2"
    out = options.out or Path("results/trace" if as_otf2 else "results/trace.json")
    if under_mpi():
        if options.ranks is not None:
            raise InputError("--ranks: given under mpirun, expected one or the other")
        trace = as_rank(_trace_here, options)
    else:
        from mp2a import files
        from mp2a.bench import otf2_writer
        from mp2a.bench.campaign import run_ranks

        (otf2_writer if as_otf2 else files).check_writable(out)
        arguments = ["trace", "--samples", options.samples, "--seed", options.seed, "--method", options.method]
        with progress(options.quiet) as say:
            trace = run_ranks([str(word) for word in arguments], options.ranks or 8, say)
    if trace is not None:
        _save(trace, out, as_otf2)
        if not options.quiet:
            _show(trace, out)


def _save(trace: dict[str, Any], out: Path, as_otf2: bool) -> None:
    if as_otf2:
        from mp2a.bench.otf2_writer import write_otf2

        write_otf2(trace, out)
    else:
        from mp2a.bench.results import write_json

        write_json(out, trace)


def _show(trace: dict[str, Any], out: Path) -> None:
    from mp2a.bench.efficiency import NOTE, efficiency, efficiency_table
    from mp2a.tables import show

    show([efficiency_table(efficiency(trace))], [NOTE, str(out)])


def _trace_here(options: argparse.Namespace) -> dict[str, Any] | None:
    """Trace as one rank of a running mpirun."""
    from mp2a.bench.timeline import trace_call

    return trace_call(options.samples, options.seed, options.method)
