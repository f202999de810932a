"""``mp2a plot``: draw results, traces and recordings."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mp2a.cli.options import command, positive_number
from mp2a.exceptions import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "plot",
        _plot,
        "Draw results (time, speedup, scaling, emulated latencies, simulated formations), the timeline of a trace, or "
        "a recording (paths of a march, its speeds and distances, an animation).",
        "  mp2a plot time results/bench.json           writes results/bench-time.png\n"
        "  mp2a plot speedup results/bench.json --against pinocchio --out speedup.pdf\n"
        "  mp2a plot scaling results/scaling.json      runs of mp2a bench --bodies and --bodies-per-rank\n"
        "  mp2a plot latency results/latency.json      runs of mp2a bench --network\n"
        "  mp2a plot simulated results/simulated.json  of benchmarks/simulate.py\n"
        "  mp2a plot timeline results/trace.json\n"
        "  mp2a plot march results/simulate.npz        of examples/simulate.py\n"
        "  mp2a plot speeds results/simulate.npz --out speeds.svg\n"
        "  mp2a plot animation results/simulate.npz    a GIF",
    )
    parser.add_argument("picture", choices=[*_FIGURES, "animation"])
    parser.add_argument("file", type=Path, help="results of mp2a bench, a trace of mp2a trace, or a recording (.npz)")
    parser.add_argument("--out", type=Path, help="picture to write (default: FILE-PICTURE.png beside the file)")
    parser.add_argument(
        "--period", type=positive_number, default=0.01, help="control period of the real-time line, s (default: 0.01)"
    )
    parser.add_argument("--against", default="pipeline", help="contender that speedup is over (default: pipeline)")


def _plot(options: argparse.Namespace) -> None:
    from mp2a.plot import save_animation, save_figure

    animated = options.picture == "animation"
    ending = "gif" if animated else "png"
    # The name of what is drawn stays in front, so that no picture takes another file's place.
    out = options.out or options.file.with_name(f"{options.file.stem}-{options.picture}.{ending}")
    if animated:
        from mp2a.simulator import load_recording

        print(save_animation(load_recording(options.file), out))
        return
    print(save_figure(_FIGURES[options.picture](options), out))


def _time(options: argparse.Namespace) -> "Figure":
    from mp2a.bench import results
    from mp2a.plot import time_figure

    return time_figure(results.load(options.file), options.period)


def _speedup(options: argparse.Namespace) -> "Figure":
    from mp2a.bench import results
    from mp2a.plot import speedup_figure

    return speedup_figure(results.load(options.file), options.against)


def _scaling(options: argparse.Namespace) -> "Figure":
    from mp2a.bench import results
    from mp2a.plot import scaling_figure

    return scaling_figure(results.load(options.file))


def _latency(options: argparse.Namespace) -> "Figure":
    from mp2a.bench import results
    from mp2a.plot import latency_figure

    return latency_figure(results.load(options.file))


def _simulated(options: argparse.Namespace) -> "Figure":
    from mp2a.bench import simulated
    from mp2a.plot import simulated_figure

    return simulated_figure(simulated.load(options.file), options.period)


def _timeline(options: argparse.Namespace) -> "Figure":
    import json

    from mp2a.plot import timeline_figure

    try:
        trace = json.loads(options.file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"file: {options.file} cannot be read as a trace ({error})") from error
    return timeline_figure(trace)


def _march(options: argparse.Namespace) -> "Figure":
    from mp2a.plot import march_figure
    from mp2a.simulator import load_recording

    return march_figure(load_recording(options.file))


def _speeds(options: argparse.Namespace) -> "Figure":
    from mp2a.plot import speeds_figure
    from mp2a.simulator import load_recording

    return speeds_figure(load_recording(options.file))


_FIGURES: "dict[str, Callable[[argparse.Namespace], Figure]]" = {
    "time": _time,
    "speedup": _speedup,
    "scaling": _scaling,
    "latency": _latency,
    "simulated": _simulated,
    "timeline": _timeline,
    "march": _march,
    "speeds": _speeds,
}
"""What is drawn. A new picture is a line here."""
