"""Who is fastest where messages take time: one sample over emulated networks of several latencies."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mp2a.exceptions import InputError
from mp2a.plot.style import (
    FAINT,
    INK,
    LOOKS,
    Look,
    canvas,
    curve,
    handle,
    legends,
    look,
    picture,
    robots_axis,
    seconds_axis,
)

CONTENDERS = tuple(name for name in LOOKS if name not in ("pinocchio", "serial", "pipeline, blocks"))
FEWEST = {"kogge-stone": 3, "compact": 2, "sweep": 1}
"""Sets of ⌈log2 n⌉ rounds a method has; below rounds times latency it cannot get."""


def emulated(results: Mapping[str, Any]) -> dict[float, list[Mapping[str, Any]]]:
    """Sort the runs over emulated networks by latency (s), each by rising n; of several runs of one n the last."""
    found: dict[float, dict[int, Mapping[str, Any]]] = {}
    for run in results.get("runs", []):
        if run.get("emulated"):
            found.setdefault(float(run["emulated"][0]), {})[int(run["n"])] = run
    if not found:
        raise InputError("results: got no run over an emulated network, expected some of mp2a bench --network")
    return {latency: [runs[n] for n in sorted(runs)] for latency, runs in sorted(found.items())}


def latency_figure(results: Mapping[str, Any]) -> Figure:
    """Draw the time of one sample over the number of robots, a panel a latency.

    Parameters
    ----------
    results : mapping
        A results file, parsed.

    Returns
    -------
    Figure
        A curve carries its contender's name as gid.

    Raises
    ------
    InputError
        If no run was over an emulated network.
    """
    panels = emulated(results)
    figure = canvas(2.4 * max(len(panels), 2) + 0.8, 3.6)
    rows = np.atleast_1d(figure.subplots(1, len(panels), sharey=True))
    for axes, (seconds, runs) in zip(rows, panels.items(), strict=True):
        _panel(axes, seconds, runs)
    rows[0].set_ylabel("time of one sample")
    bandwidths = sorted({run["emulated"][1] / 1e6 for runs in panels.values() for run in runs})
    network = " and ".join(f"{bandwidth:g}" for bandwidth in bandwidths)
    figure.suptitle(
        f"emulated network, {network} Mbit/s: measured over messages that are handed over late", fontsize=10
    )
    present = [c for c in CONTENDERS if any(c in run["measured"] for runs in panels.values() for run in runs)]
    floor = handle(Look("rounds × latency: kogge-stone, compact, sweep", FAINT, ""), (0, (1, 1.5)))
    half = (len(present) + 1) // 2
    groups = [
        ("measured, wall clock", [handle(look(c)) for c in present[:half]]),
        (" ", [handle(look(c)) for c in present[half:]]),
    ]
    legends(figure, [*groups, ("for comparison", [floor])])
    return figure


latency = picture(latency_figure)


def _panel(axes: Axes, seconds: float, runs: list[Mapping[str, Any]]) -> None:
    for contender in CONTENDERS:
        points = [
            (run["n"], run["measured"][contender]["single"]["wall"]) for run in runs if contender in run["measured"]
        ]
        if points:
            n, wall = np.array(points).T
            curve(axes, n, wall, look(contender), gid=contender)
    largest = max(run["n"] for run in runs)
    n = np.array([2**k for k in range(1, int(np.log2(largest)) + 1)])
    for method, sets in FEWEST.items():
        rounds = sets * np.ceil(np.log2(n))
        axes.plot(n, rounds * seconds, color=FAINT, linestyle=(0, (1, 1.5)), linewidth=1.0, gid=f"floor {method}")
    robots_axis(axes, largest, smallest=min(run["n"] for run in runs))
    seconds_axis(axes)
    axes.set_title(f"latency {1e3 * seconds:g} ms", color=INK)
