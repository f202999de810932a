"""``mp2a plot``: draw results and traces."""

import argparse
from pathlib import Path
from typing import Any

from mp2a.cli.options import command, positive_number
from mp2a.exceptions import InputError


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "plot",
        _plot,
        "Draw results: time, speedup, emulated latencies, simulated formations, or the timeline of a trace.",
        "  mp2a plot time results/bench.json\n"
        "  mp2a plot speedup results/bench.json --against pinocchio --out speedup.pdf\n"
        "  mp2a plot latency results/latency.json     runs of mp2a bench --network\n"
        "  mp2a plot simulated results/simulated.json  of benchmarks/simulate.py\n"
        "  mp2a plot timeline results/trace.json",
    )
    parser.add_argument("picture", choices=("time", "speedup", "latency", "simulated", "timeline"))
    parser.add_argument("file", type=Path, help="a results file of mp2a bench, or a trace file of mp2a trace")
    parser.add_argument("--out", type=Path, help="picture to write (default: beside the file)")
    parser.add_argument(
        "--period", type=positive_number, default=0.01, help="control period of the real-time line, s (default: 0.01)"
    )
    parser.add_argument("--against", default="relay", help="contender that speedup is over (default: relay)")


def _plot(options: argparse.Namespace) -> None:
    import json

    from mp2a import plot
    from mp2a.bench import results

    out = options.out or options.file.with_name(f"{options.picture}.png")
    if options.picture == "timeline":
        try:
            trace = json.loads(options.file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"file: {options.file} cannot be read as a trace ({error})") from error
        written = plot.timeline(trace, out)
    elif options.picture == "latency":
        written = plot.latency(results.load(options.file), out)
    elif options.picture == "simulated":
        from mp2a.bench import simulated

        written = plot.simulated(simulated.load(options.file), out, period=options.period)
    elif options.picture == "time":
        written = plot.time(results.load(options.file), out, period=options.period)
    else:
        written = plot.speedup(results.load(options.file), out, against=options.against)
    print(written)
