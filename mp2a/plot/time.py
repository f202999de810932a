"""The paper's figure 9: the time that a whole trajectory takes, over the number of robots."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mp2a.exceptions import InputError
from mp2a.plot.looks import FAINT, INK, Look, look
from mp2a.plot.measurements import (
    GRAINS,
    PAPER_ROBOTS,
    PAPER_SAMPLES,
    SOURCES,
    contenders,
    grain_title,
    hollow_note,
    origin,
    plural,
    runs,
    sample_count,
    series,
)
from mp2a.plot.panels import Curve, draw_lines, draw_rows, in_seconds, legend_groups, rows_height, rows_of
from mp2a.plot.style import Dashes, canvas, handle, legends, log_axis, remark, styled

_LINES: dict[str, Dashes] = {"measured": "-", "modelled": (0, (5, 2)), "extrapolated": (0, (1, 1.5))}
_MARKS = {"modelled": "+", "extrapolated": "x"}
_GROUPS = {
    "measured": "measured, wall clock",
    "modelled": "modelled, eq. 13",
    "extrapolated": "extrapolated, a core a robot",
}
_PAPER = (
    ("kogge-stone", 0.152, Look("paper: MP²A, 0.152 s", INK, "*")),
    ("serial", 6.4, Look("paper: O(n), 6.4 s", INK, "P")),
)
"""What the paper states for `PAPER_ROBOTS` and `PAPER_SAMPLES`."""


@styled()
def time_figure(results: Mapping[str, Any], period: float = 0.01) -> Figure:
    """Draw the time of the whole trajectory over the number of robots, as the paper's figure 9.

    Parameters
    ----------
    results
        A results file of ``mp2a bench``, parsed. If it is about one number of robots, every curve is a row.
    period
        Control period in seconds: below samples × period the formation is computed in real time.

    Returns
    -------
    Figure
        A panel for each way in which samples travel; every curve carries its name as gid, "measured kogge-stone" for
        instance.

    Raises
    ------
    InputError
        For results without runs or times, or a period that is no time.
    """
    if not isinstance(period, int | float) or not 0 < period < np.inf:
        raise InputError(f"period: got {period!r}, expected seconds above 0")
    count, sizes = sample_count(results), [run["n"] for run in runs(results)]
    panels = {grain: _curves(results, grain) for grain in GRAINS if count > 1 or grain == "single"}
    panels = {grain: curves for grain, curves in panels.items() if curves}
    if not panels:
        raise InputError("results: got runs without a single time, expected measured, modelled or extrapolated times")
    inside = sizes[0] <= PAPER_ROBOTS <= sizes[-1]
    if inside:
        panels = {grain: curves + _paper(count) for grain, curves in panels.items()}
    what = f"time for the whole trajectory, {count} samples" if count > 1 else "time of one sample"
    note = origin("measured", runs(results))
    if len(sizes) == 1:
        figure = _rows(panels, what, count, count * period)
        groups: list[tuple[str, list[Artist]]] = []
    else:
        figure = _lines(panels, what, count, count * period, sizes)
        groups = legend_groups([line for curves in panels.values() for line in curves if line.group != "paper"])
    for axes, grain in zip(figure.axes, panels, strict=False):
        axes.set_title(grain_title(results, grain))
    if len(sizes) == 1:
        figure.suptitle(plural(sizes[0], "robot"))
    scaled = "" if count == PAPER_SAMPLES else f", for {count} of its {PAPER_SAMPLES} samples"
    marks: list[Artist] = [
        handle(shape._replace(label=f"{shape.label} at n = {PAPER_ROBOTS}{scaled}"), "none")
        if inside
        else remark(f"{shape.label} at n = {PAPER_ROBOTS}")
        for _, _, shape in _PAPER
    ]
    real = handle(Look(f"real time at a control period of {period * 1e3:g} ms", FAINT, ""), "-.")
    legends(figure, [*groups, ("for comparison", [real, *hollow_note(runs(results)), *marks])], note)
    return figure


def _curves(results: Mapping[str, Any], grain: str) -> list[Curve]:
    """Return the curves of a panel, in seconds for the whole trajectory."""
    out = []
    for source in SOURCES:
        for who in contenders(results, source):
            n, seconds, shared = series(results, source, who, grain)
            times, shape = (
                seconds * sample_count(results),
                look(who)._replace(marker=_MARKS.get(source, look(who).marker)),
            )
            if len(n):
                name = f"{source} {who}"
                out.append(Curve(name, _GROUPS[source], shape, _LINES[source], n, times, shared, in_seconds(times)))
    return out


def _paper(count: int) -> list[Curve]:
    out = []
    for who, seconds, shape in _PAPER:
        n, times = np.array([PAPER_ROBOTS]), np.array([seconds * count / PAPER_SAMPLES])
        out.append(Curve(f"paper {who}", "paper", shape, "none", n, times, np.array([False]), in_seconds(times)))
    return out


def _per_sample(count: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return how an axis of seconds for a trajectory becomes one of seconds for a sample, and back."""
    return lambda seconds: seconds / count, lambda seconds: seconds * count


def _lines(panels: Mapping[str, list[Curve]], what: str, count: int, real: float, sizes: list[int]) -> Figure:
    figure = canvas(9.6 if len(panels) > 1 else 7.2, 4.4)
    drawn = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    for axes, curves in zip(drawn, panels.values(), strict=True):
        draw_lines(axes, curves, sizes)
        axes.axhline(real, color=FAINT, linestyle="-.", linewidth=1.2, gid="real time")
    for axes in drawn:
        log_axis(axes.yaxis, "s", axes.get_ylim())
    drawn[0].set_ylabel(what)
    if count > 1:
        low, high = drawn[-1].get_ylim()
        right = drawn[-1].secondary_yaxis("right", functions=_per_sample(count))
        log_axis(right.yaxis, "s", (low / count, high / count))
        right.set_ylabel("time per sample")
        if len(panels) > 1:
            _grid_of(right, drawn[-1], count)
    return figure


def _grid_of(right: Axes, axes: Axes, count: int) -> None:
    """Move a panel's horizontal grid to the labels on its right, seconds of a sample."""
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", left=False)
    low, high = axes.get_ylim()
    for place in right.get_yticks() * count:
        if low < place < high:
            axes.axhline(place, color=rcParams["grid.color"], linewidth=rcParams["grid.linewidth"], zorder=0.5)


def _rows(panels: Mapping[str, list[Curve]], what: str, count: int, real: float) -> Figure:
    rows = rows_of([line for curves in panels.values() for line in curves])
    figure = canvas(9.6 if len(panels) > 1 else 7.2, rows_height(rows) + 1.5)
    drawn: list[Axes] = list(figure.subplots(1, len(panels), sharey=True, squeeze=False)[0])
    for axes, curves in zip(drawn, panels.values(), strict=True):
        axes.axvline(real, color=FAINT, linestyle="-.", linewidth=1.2, gid="real time", zorder=1)
        draw_rows(axes, curves, rows, "s")
        axes.set_xlabel(what)
        if count > 1:
            low, high = axes.get_xlim()
            top = axes.secondary_xaxis("top", functions=_per_sample(count))
            log_axis(top.xaxis, "s", (low / count, high / count))
            top.set_xlabel("time per sample")
    return figure
