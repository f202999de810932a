"""Formations beyond this machine: simulated times over the number of robots, a panel for each network."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from mp2a.exceptions import InputError
from mp2a.plot.looks import FAINT, Look, in_order, look
from mp2a.plot.measurements import origin, plural
from mp2a.plot.panels import Curve, draw_lines, draw_rows, in_seconds, legend_groups, rows_height, rows_of
from mp2a.plot.style import canvas, handle, legends, log_axis, remark, styled

_WIDTH, _HEIGHT = 2.75, 2.5  # inches of a panel
_LABELS = 2.2  # inches beside rows
_GROUP = "simulated"


@styled()
def simulated_figure(results: Mapping[str, Any], period: float = 0.01) -> Figure:
    """Draw simulated times over the number of robots.

    Parameters
    ----------
    results
        A file of simulated times, parsed. If all are of one number of robots, every contender is a row.
    period
        Control period in seconds.

    Returns
    -------
    Figure
        A column for each network, and a row for each number of samples; a curve carries its contender's name as gid.

    Raises
    ------
    InputError
        For a file without times.
    """
    points = results.get("points") if isinstance(results, Mapping) else None
    if not points:
        raise InputError("results: got no simulated times, expected at least one")
    order = list(results["networks"])
    networks = sorted(
        {point["network"] for point in points},
        key=lambda name: (results["networks"][name]["latency"], order.index(name)),
    )
    counts = sorted({point["samples"] for point in points})
    sizes = sorted({point["n"] for point in points})
    panels = {(count, name): _curves(points, count, name) for count in counts for name in networks}
    everything = [line for curves in panels.values() for line in curves]
    rows = rows_of(everything)
    single = len(sizes) == 1
    height = (rows_height(rows) + 0.5) if single else _HEIGHT
    width = _WIDTH * max(len(networks), 3) + (_LABELS if single else 0)
    figure = canvas(width, height * len(counts) + 0.4)
    grid = figure.subplots(
        len(counts), len(networks), squeeze=False, sharex=not single, sharey="row" if single else False
    )
    for axes, ((count, _), curves) in zip(grid.flat, panels.items(), strict=True):
        if single:
            draw_rows(axes, curves, rows, "s")
            _real_time(axes.get_xlim(), axes.axvline, count * period)
        elif curves:
            draw_lines(axes, curves, sizes)
            _real_time(axes.get_ylim(), axes.axhline, count * period)
            log_axis(axes.yaxis, "s", axes.get_ylim())
    for axes, name in zip(grid[0], networks, strict=True):
        axes.set_title(_title(results["networks"][name]))
    for row, count in zip(grid, counts, strict=True):
        what = f"simulated time of a call,\n{plural(count, 'sample')} in each message"
        if single:
            for axes in row:
                axes.set_xlabel(what)
        else:
            row[0].set_ylabel(what)
    if not single:
        for axes in grid[:-1].flat:
            axes.set_xlabel("")
    robots = f", {plural(sizes[0], 'robot')}" if single else ""
    figure.suptitle(f"Simulated ({results['simulated']}): one call{robots}, on networks this machine does not have")
    within = any(line.get_gid() == "real time" for axes in figure.axes for line in axes.lines)
    label = f"real time at a control period of {period * 1e3:g} ms"
    real = [handle(Look(label, FAINT, ""), "-.", linewidth=1.2)] if within else []
    groups = [] if single else legend_groups(everything)
    remarks = [remark(text) for text in _remarks(results, points)]
    note = origin("computing measured", [results])
    legends(figure, [*groups, ("for comparison", real), ("what is simulated", remarks)], note)
    return figure


def _curves(points: list[Mapping[str, Any]], count: int, network: str) -> list[Curve]:
    """Return the curves of a panel."""
    here = [point for point in points if point["network"] == network and point["samples"] == count]
    out = []
    for name in in_order({point["contender"] for point in here}):
        line = sorted((point["n"], point["seconds"]) for point in here if point["contender"] == name)
        n, seconds = np.array(line, dtype=float).T
        out.append(Curve(name, _GROUP, look(name), "-", n, seconds, np.zeros(len(n), dtype=bool), in_seconds(seconds)))
    return out


def _real_time(limits: tuple[float, float], line: Any, seconds: float) -> None:
    """Draw how long a call may take where that is among the times shown."""
    if limits[0] < seconds < limits[1]:
        line(seconds, color=FAINT, linestyle="-.", linewidth=1.2, gid="real time")


def _title(network: Mapping[str, Any]) -> str:
    latency = EngFormatter("s", sep=" ")(network["latency"])
    speed = EngFormatter("bit/s", sep=" ")(network["speed"])
    return f"{network['label']}\n{latency}, {speed}"


def _remarks(results: Mapping[str, Any], points: list[Mapping[str, Any]]) -> list[str]:
    out = [
        "computing: as measured for one robot on one core",
        "network: latency and bandwidth, one hop from each robot to each",
        "no processor time a message, which is kind to gather-scatter",
    ]
    largest = max(point["n"] for point in points)
    if results.get("left_out") or any(point["n"] < largest for point in _ends(points)):
        out.append("a line ends where simulating it would take too long")
    return out


def _ends(points: list[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the last point of each line."""
    rising = sorted(points, key=lambda point: point["n"])
    return list({(point["network"], point["contender"], point["samples"]): point for point in rising}.values())
