"""Formations beyond this machine: simulated times over the number of robots, a panel a network."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, FixedFormatter, FixedLocator

from mp2a.exceptions import InputError
from mp2a.plot.style import FAINT, LOOKS, Look, canvas, curve, handle, legends, look, picture, robots_axis, seconds_axis

_WIDTH, _HEIGHT = 2.75, 2.5
_MOST_TICKS = 6


def simulated_figure(results: Mapping[str, Any], period: float = 0.01) -> Figure:
    """Draw simulated times over the number of robots.

    Parameters
    ----------
    results : mapping
        A file of simulated times, parsed.
    period : float
        Control period in seconds.

    Returns
    -------
    Figure
        A column a network, a row a number of samples; a curve carries its contender's name as gid.

    Raises
    ------
    InputError
        For a file without times.
    """
    points = results.get("points") if isinstance(results, Mapping) else None
    if not points:
        raise InputError("results: got no simulated times, expected at least one")
    shown = {p["network"] for p in points}
    networks = sorted(
        shown, key=lambda name: (results["networks"][name]["latency"], list(results["networks"]).index(name))
    )
    counts = sorted({p["samples"] for p in points})
    names = _contenders(points)
    figure = canvas(_WIDTH * max(len(networks), 3), _HEIGHT * len(counts) + 0.4)
    grid = figure.subplots(len(counts), len(networks), squeeze=False, sharex=True)
    for row, count in zip(grid, counts, strict=True):
        for axes, network in zip(row, networks, strict=True):
            here = [p for p in points if p["network"] == network and p["samples"] == count]
            _panel(axes, here, names, count * period)
        row[0].set_ylabel(f"simulated time of a call,\n{count} sample{'s' * (count > 1)} in each message")
    largest = max(p["n"] for p in points)
    for axes in grid.flat:
        _robots(axes, largest)
    for axes, network in zip(grid[0], networks, strict=True):
        axes.set_title(_title(results["networks"][network]))
    for axes in grid[:-1].flat:
        axes.set_xlabel("")
    figure.suptitle(f"Simulated ({results['simulated']}): one call, on networks this machine does not have")
    real = handle(Look(f"real time at a control period of {period * 1e3:g} ms", FAINT, ""), "-.", linewidth=1.2)
    legends(
        figure,
        [
            ("simulated", [handle(look(name)) for name in names]),
            ("for comparison", [real]),
            ("what is simulated", [handle(Look(text, FAINT, ""), "none") for text in _remarks(results, points)]),
        ],
    )
    return figure


simulated = picture(simulated_figure)


def _panel(axes: Axes, points: list[Mapping[str, Any]], names: list[str], period: float) -> None:
    for name in names:
        line = sorted((p["n"], p["seconds"]) for p in points if p["contender"] == name)
        if line:
            n, seconds = np.array(line, dtype=float).T
            curve(axes, n, seconds, look(name), gid=name)
    seconds_axis(axes)
    low, high = axes.get_ylim()
    if low < period < high:
        axes.axhline(period, color=FAINT, linestyle="-.", linewidth=1.2, gid="real time")


def _robots(axes: Axes, largest: int) -> None:
    robots_axis(axes, largest, 8)
    powers = 2 ** np.arange(3, int(np.log2(max(largest, 8))) + 1)
    powers = powers[:: -(-len(powers) // _MOST_TICKS)]
    axes.xaxis.set_major_locator(FixedLocator(powers.tolist()))
    axes.xaxis.set_major_formatter(FixedFormatter([str(p) for p in powers]))


def _title(network: Mapping[str, Any]) -> str:
    latency = EngFormatter("s", sep=" ")(network["latency"])
    speed = EngFormatter("bit/s", sep=" ")(network["speed"])
    return f"{network['label']}\n{latency}, {speed}"


def _remarks(results: Mapping[str, Any], points: list[Mapping[str, Any]]) -> list[str]:
    out = [
        "computing: as measured for one robot on one core here",
        "network: latency and bandwidth, one hop from each robot to each",
        "no processor time a message, which is kind to gather-scatter",
    ]
    largest = max(p["n"] for p in points)
    if results.get("left_out") or any(p["n"] < largest for p in _ends(points)):
        out.append("a line ends where simulating it would take too long")
    return out


def _ends(points: list[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Last point of each line."""
    rising = sorted(points, key=lambda p: p["n"])
    return list({(p["network"], p["contender"], p["samples"]): p for p in rising}.values())


def _contenders(points: list[Mapping[str, Any]]) -> list[str]:
    held = {p["contender"] for p in points}
    known = [name for name in LOOKS if name in held]
    return list(dict.fromkeys([*known, *sorted(held - set(known))]))
