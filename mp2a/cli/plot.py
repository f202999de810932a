"""``mp2a plot``: draw results, traces and recordings."""

import argparse
from collections.abc import Callable
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
        "Draw results (time, speedup, emulated latencies, simulated formations), the timeline of a trace, or a "
        "recording (paths of a march, its speeds and distances, an animation).",
        "  mp2a plot time results/bench.json\n"
        "  mp2a plot speedup results/bench.json --against pinocchio --out speedup.pdf\n"
        "  mp2a plot latency results/latency.json     runs of mp2a bench --network\n"
        "  mp2a plot simulated results/simulated.json  of benchmarks/simulate.py\n"
        "  mp2a plot timeline results/trace.json\n"
        "  mp2a plot march results/simulate.npz        of examples/simulate.py\n"
        "  mp2a plot speeds results/simulate.npz --out speeds.svg\n"
        "  mp2a plot animation results/simulate.npz    a GIF",
    )
    parser.add_argument("picture", choices=_PICTURES)
    parser.add_argument("file", type=Path, help="results of mp2a bench, a trace of mp2a trace, or a recording (.npz)")
    parser.add_argument("--out", type=Path, help="picture to write (default: beside the file)")
    parser.add_argument(
        "--period", type=positive_number, default=0.01, help="control period of the real-time line, s (default: 0.01)"
    )
    parser.add_argument("--against", default="pipeline", help="contender that speedup is over (default: pipeline)")


def _plot(options: argparse.Namespace) -> None:
    ending = "gif" if options.picture == "animation" else "png"
    out = options.out or options.file.with_name(f"{options.picture}.{ending}")
    print(_PICTURES[options.picture](options, out))


def _time(options: argparse.Namespace, out: Path) -> Path:
    from mp2a import plot
    from mp2a.bench import results

    return plot.time(results.load(options.file), out, period=options.period)


def _speedup(options: argparse.Namespace, out: Path) -> Path:
    from mp2a import plot
    from mp2a.bench import results

    return plot.speedup(results.load(options.file), out, against=options.against)


def _latency(options: argparse.Namespace, out: Path) -> Path:
    from mp2a import plot
    from mp2a.bench import results

    return plot.latency(results.load(options.file), out)


def _simulated(options: argparse.Namespace, out: Path) -> Path:
    from mp2a import plot
    from mp2a.bench import simulated

    return plot.simulated(simulated.load(options.file), out, period=options.period)


def _timeline(options: argparse.Namespace, out: Path) -> Path:
    import json

    from mp2a import plot

    try:
        trace = json.loads(options.file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"file: {options.file} cannot be read as a trace ({error})") from error
    return plot.timeline(trace, out)


def _recorded(options: argparse.Namespace, out: Path) -> Path:
    from mp2a import plot
    from mp2a.simulator.recording import Recording

    draw = {"march": plot.march, "speeds": plot.speeds, "animation": plot.animation}[options.picture]
    return draw(Recording.load(options.file), out)


_PICTURES: dict[str, Callable[[argparse.Namespace, Path], Path]] = {
    "time": _time,
    "speedup": _speedup,
    "latency": _latency,
    "simulated": _simulated,
    "timeline": _timeline,
    "march": _recorded,
    "speeds": _recorded,
    "animation": _recorded,
}
