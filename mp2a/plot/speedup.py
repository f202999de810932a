"""The paper's figure 10: how many times faster the formation is than an opponent, beside Amdahl's law."""

from collections.abc import Mapping
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from mp2a.cost_model import amdahl, karp_flatt
from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.plot.style import (
    FAINT,
    INK,
    PAPER_ROBOTS,
    Dashes,
    Look,
    canvas,
    curve,
    handle,
    legends,
    look,
    picture,
    robots_axis,
    spread,
)
from mp2a.plot.time import GRAINS, contenders, grain_title, hollow_note, runs, series

OURS = tuple(METHODS)
PARALLEL_PARTS = (0.7, 0.8, 0.9, 0.95, 0.97, 0.99, 0.992)
PAPER_SPEEDUP = 42.1
_AMDAHL = "#b9b9b9"
_LINES: dict[str, Dashes] = {"measured": "-", "extrapolated": (0, (1, 1.5))}
_LABEL_GAP = 10.5  # points from one end label to the next


class Speedup(NamedTuple):
    """One curve of speedups, with the parallel part of Amdahl's law that each point amounts to."""

    n: np.ndarray
    speedup: np.ndarray
    parallel_part: np.ndarray
    oversubscribed: np.ndarray


def speedups(
    results: Mapping[str, Any], against: str, grain: str, source: str = "measured", method: str = "kogge-stone"
) -> Speedup:
    """Divide an opponent's times by those of a method, where the results hold both.

    Parameters
    ----------
    results : mapping
        A results file, parsed.
    against : str
        The opponent.
    grain : {"batch", "single"}
        Whether all samples travel in each message, or one at a time.
    source : {"measured", "extrapolated"}
        Which times. An opponent in one process needs no more than the core it has, so where the results
        do not extrapolate pinocchio, its measured time stands for itself.
    method : str
        Ours.

    Returns
    -------
    Speedup
        Its `parallel_part` is Karp and Flatt's; NaN for one robot, of which there is none.
    """
    ours = series(results, source, method, grain)
    theirs = series(results, source, against, grain)
    if source == "extrapolated" and against == "pinocchio" and not len(theirs.n):
        theirs = series(results, "measured", against, grain)
    n, mine, other = np.intersect1d(ours.n, theirs.n, return_indices=True)
    ratio = theirs.seconds[other] / ours.seconds[mine]
    part = np.full(len(n), np.nan)
    part[n > 1] = karp_flatt(ratio[n > 1], n[n > 1])
    return Speedup(n, ratio, part, ours.oversubscribed[mine])


def speedup_figure(results: Mapping[str, Any], against: str = "pipeline") -> Figure:
    """Draw the speedup over the number of robots beside Amdahl's law, as the paper's figure 10.

    Parameters
    ----------
    results : mapping
        A results file, parsed.
    against : str
        Whose times are divided by ours: pipeline, gather-scatter or pinocchio.

    Returns
    -------
    Figure
        Two panels; a curve carries its name as gid: "measured sweep", "extrapolated sweep", "amdahl 0.97".

    Raises
    ------
    InputError
        For results without runs, or an opponent without times.
    """
    rivals = [who for who in contenders(results, "measured") if who not in OURS]
    if against not in rivals:
        known = ", ".join(rivals) or "none"
        raise InputError(f"against: got {against!r}, expected an opponent these results measured: {known}")
    curves = {
        grain: {(source, who): speedups(results, against, grain, source, who) for who in OURS for source in _LINES}
        for grain in GRAINS
    }
    drawn = [key for key in curves["single"] if any(len(curves[grain][key].n) for grain in GRAINS)]
    if not drawn:
        raise InputError(f"against: got {against!r}, of which no run has times beside ours, expected at least one")
    largest = max(PAPER_ROBOTS, runs(results)[-1]["n"])
    figure = canvas(9.6, 4.3)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, grain in zip(panels, GRAINS, strict=True):
        _panel(axes, curves[grain], largest)
        axes.set_title(grain_title(results, grain))
    panels[0].set_ylabel(f"speedup S = T({against}) / T(method)")
    titles = {"measured": "measured, wall clock", "extrapolated": "extrapolated, a core a robot"}
    groups = [
        (titles[source], [handle(_shape(source, who), _LINES[source]) for kind, who in drawn if kind == source])
        for source in _LINES
    ]
    note = hollow_note(results) if groups[0][1] else None
    law = [
        handle(Look(r"Amdahl, $S = n\,/\,(f_s n + f_p),\;\; f_s = 1 - f_p$", _AMDAHL, "")),
        handle(Look("as fast as the opponent, S = 1", FAINT, ""), "-.", linewidth=1.2),
    ]
    star = Look(f"paper: S = {PAPER_SPEEDUP} at n = {PAPER_ROBOTS}", INK, "*")
    paper = handle(star, "none", markersize=9, markeredgewidth=0)
    legends(
        figure,
        [*groups, ("for comparison, $\\mathbf{f_p}$ by Karp and Flatt", [*law, paper, *([note] if note else [])])],
    )
    figure.draw_without_rendering()  # labels can be kept apart only once the panels have their size
    for axes in panels:
        _keep_apart(axes)
    return figure


speedup = picture(speedup_figure)


def _panel(axes: Axes, curves: Mapping[tuple[str, str], Speedup], largest: int) -> None:
    n = np.geomspace(1, largest, 200)
    for part in PARALLEL_PARTS:
        law = amdahl(n, part)
        axes.plot(n, law, color=_AMDAHL, linewidth=1.0, zorder=1, gid=f"amdahl {part}")
        _label(axes, largest, law[-1], f"$f_p$ = {part:g}", "#6e6e6e")
    axes.axhline(1, color=FAINT, linestyle="-.", linewidth=1.2, zorder=1)
    last = max((int(line.n[-1]) for line in curves.values() if len(line.n)), default=0)
    for (source, who), line in curves.items():
        shape = _shape(source, who)
        curve(axes, line.n, line.speedup, shape, _LINES[source], line.oversubscribed, f"{source} {who}")
        if len(line.n) and 1 < line.n[-1] == last:
            text = f"S = {line.speedup[-1]:.3g}, {_part(line.parallel_part[-1])}"
            _label(axes, line.n[-1], line.speedup[-1], text, shape.color)
    axes.plot(
        PAPER_ROBOTS,
        PAPER_SPEEDUP,
        linestyle="none",
        marker="*",
        color=INK,
        markersize=10,
        markeredgewidth=0,
        zorder=6,
        gid="paper",
    )
    _label(axes, PAPER_ROBOTS, PAPER_SPEEDUP, f"paper: S = {PAPER_SPEEDUP}", INK)
    robots_axis(axes, largest)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", left=False)


def _label(axes: Axes, n: float, value: float, text: str, color: str) -> None:
    place: dict[str, Any] = {"xytext": (9, 0), "textcoords": "offset points", "va": "center", "annotation_clip": False}
    axes.annotate(text, (n, value), color=color, fontsize=8, **place)


def _keep_apart(axes: Axes) -> None:
    labels = sorted((a for a in axes.texts if isinstance(a, Annotation)), key=lambda a: a.xy[0])
    for _, found in groupby(labels, key=lambda a: a.xy[0]):
        crowd = list(found)
        points = 72 / axes.figure.dpi
        heights = np.array([axes.transData.transform(a.xy)[1] for a in crowd]) * points
        for label, shift in zip(crowd, spread(heights, _LABEL_GAP) - heights, strict=True):
            label.set_position((9, shift))


def _part(parallel_part: float) -> str:
    return "$f_p$ < 0" if parallel_part < 0 else f"$f_p$ = {parallel_part:.3f}"


def _shape(source: str, method: str) -> Look:
    return look(method) if source == "measured" else look(method)._replace(marker="x")
