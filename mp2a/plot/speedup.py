"""The paper's figure 10: how many times faster the formation is than an opponent, beside Amdahl's law."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from mp2a.bench.contenders import PINOCCHIO, PIPELINE
from mp2a.cost_model import amdahl, karp_flatt
from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.plot.looks import FAINT, INK, Look, look
from mp2a.plot.measurements import (
    GRAINS,
    PAPER_ROBOTS,
    contenders,
    grain_title,
    hollow_note,
    origin,
    plural,
    runs,
    sample_count,
    series,
)
from mp2a.plot.panels import Curve, draw_lines, draw_rows, robot_counts, rows_height, rows_of
from mp2a.plot.style import Dashes, canvas, handle, legends, log_axis, remark, spread, styled

OURS = tuple(METHODS)
PARALLEL_PARTS = (0.7, 0.8, 0.9, 0.95, 0.97, 0.99, 0.992)
PAPER_SPEEDUP = 42.1
_AMDAHL = "#b9b9b9"
_LINES: dict[str, Dashes] = {"measured": "-", "extrapolated": (0, (1, 1.5))}
_GROUPS = {"measured": "measured, wall clock", "extrapolated": "extrapolated, a core a robot"}
_PAPER = Look(f"paper: S = {PAPER_SPEEDUP} at n = {PAPER_ROBOTS}", INK, "*")
_LABEL_GAP = 12.0  # points from one label of Amdahl's law to the next


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
    results
        A results file, parsed.
    against
        The opponent.
    grain
        "batch" or "single": whether all samples travel in each message, or one at a time.
    source
        "measured" or "extrapolated". An opponent in one process needs no more than the core it has, so where the
        results do not extrapolate pinocchio, its measured time stands for itself.
    method
        One of ours.

    Returns
    -------
    Speedup
        Its `parallel_part` is Karp and Flatt's; NaN for one robot, of which there is none.
    """
    ours = series(results, source, method, grain)
    theirs = series(results, source, against, grain)
    if source == "extrapolated" and against == PINOCCHIO and not len(theirs.n):
        theirs = series(results, "measured", against, grain)
    n, mine, other = np.intersect1d(ours.n, theirs.n, return_indices=True)
    ratio = theirs.seconds[other] / ours.seconds[mine]
    part = np.full(len(n), np.nan)
    part[n > 1] = karp_flatt(ratio[n > 1], n[n > 1])
    return Speedup(n, ratio, part, ours.oversubscribed[mine])


@styled()
def speedup_figure(results: Mapping[str, Any], against: str = PIPELINE) -> Figure:
    """Draw the speedup over the number of robots beside Amdahl's law, as the paper's figure 10.

    Parameters
    ----------
    results
        A results file of ``mp2a bench``, parsed. If it is about one number of robots, every curve is a row.
    against
        The contender whose times are divided by ours, "pipeline" or "pinocchio" for instance.

    Returns
    -------
    Figure
        A panel for each way in which samples travel; a curve carries its name as gid: "measured sweep", "extrapolated
        sweep", "amdahl 0.97".

    Raises
    ------
    InputError
        For results without runs, or an opponent without times.
    """
    rivals = [who for who in contenders(results, "measured") if who not in OURS]
    if against not in rivals:
        known = ", ".join(rivals) or "none"
        raise InputError(f"against: got {against!r}, expected an opponent these results measured: {known}")
    panels = {
        grain: _curves(results, against, grain) for grain in GRAINS if sample_count(results) > 1 or grain == "single"
    }
    panels = {grain: curves for grain, curves in panels.items() if curves}
    if not panels:
        raise InputError(f"against: got {against!r}, of which no run has times beside ours, expected at least one")
    counts = robot_counts([line for curves in panels.values() for line in curves])
    sizes = counts if len(counts) == 1 else [run["n"] for run in runs(results)]
    inside = sizes[0] <= PAPER_ROBOTS <= sizes[-1]
    if inside:
        panels = {grain: [*curves, _paper()] for grain, curves in panels.items()}
    what = f"speedup S = T({against}) / T(method)"
    paper = handle(_PAPER, "none") if inside else remark(_PAPER.label)
    equal = handle(Look("as fast as the opponent, S = 1", FAINT, ""), "-.", linewidth=1.2)
    law = handle(Look(r"Amdahl, $S = n\,/\,(f_s n + f_p),\;\; f_s = 1 - f_p$", _AMDAHL, ""))
    note = hollow_note(runs(results))
    if len(sizes) == 1:
        figure = _rows(panels, what, sizes[0])
        groups = [("for comparison", [equal, paper, *note])]
    else:
        figure = _lines(panels, what, sizes)
        end = f"S and $\\mathbf{{f_p}}$ at n = {counts[-1]}"
        ends = [(f"{grain_title(results, grain)}\n{end}", _ends(panels[grain], counts[-1])) for grain in panels]
        groups = [*ends, ("for comparison,\n$\\mathbf{f_p}$ by Karp and Flatt", [law, equal, paper, *note])]
    for axes, grain in zip(figure.axes, panels, strict=True):
        axes.set_title(grain_title(results, grain))
    legends(figure, groups, origin("measured", runs(results)))
    if len(sizes) > 1:
        figure.draw_without_rendering()  # labels can be kept apart only once the panels have their size
        for axes in figure.axes:
            _keep_apart(axes)
    return figure


def _curves(results: Mapping[str, Any], against: str, grain: str) -> list[Curve]:
    out = []
    for source, dashes in _LINES.items():
        for who in OURS:
            line = speedups(results, against, grain, source, who)
            if len(line.n):
                shape = look(who) if source == "measured" else look(who)._replace(marker="x")
                numbers = [_number(*pair) for pair in zip(line.speedup, line.parallel_part, strict=True)]
                name, group = f"{source} {who}", _GROUPS[source]
                out.append(Curve(name, group, shape, dashes, line.n, line.speedup, line.oversubscribed, numbers))
    return out


def _paper() -> Curve:
    part = float(karp_flatt(np.array([PAPER_SPEEDUP]), np.array([PAPER_ROBOTS]))[0])
    n, value, filled = np.array([PAPER_ROBOTS]), np.array([PAPER_SPEEDUP]), np.array([False])
    return Curve("paper", "paper", _PAPER, "none", n, value, filled, [_number(PAPER_SPEEDUP, part)])


def _number(value: float, part: float) -> str:
    """Write a speedup and its parallel part, where there is one."""
    if np.isnan(part):
        return f"S = {value:.3g}"
    return f"S = {value:.3g}, $f_p$ {'< 0' if part < 0 else f'= {part:.3f}'}"


def _ends(curves: Sequence[Curve], last: int) -> list[Artist]:
    """Return entries of a legend that tell where curves end at the largest number of robots."""
    out: list[Artist] = []
    for line in curves:
        if line.gid != "paper":
            end = line.numbers[-1] if line.n[-1] == last else "-"
            source, _, method = line.gid.partition(" ")
            out.append(handle(line.look._replace(label=f"{method}, {source}: {end}"), line.line))
    return out


def _lines(panels: Mapping[str, list[Curve]], what: str, sizes: Sequence[int]) -> Figure:
    figure = canvas(9.6 if len(panels) > 1 else 7.2, 4.3)
    drawn = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    n = np.geomspace(sizes[0], sizes[-1], 200)
    for axes, curves in zip(drawn, panels.values(), strict=True):
        for part in PARALLEL_PARTS:
            law = amdahl(n, part)
            axes.plot(n, law, color=_AMDAHL, linewidth=1.0, zorder=1, gid=f"amdahl {part}")
            _label(axes, n[-1], law[-1], f"$f_p$ = {part:g}")
        axes.axhline(1, color=FAINT, linestyle="-.", linewidth=1.2, zorder=1)
        draw_lines(axes, curves, sizes)
    for axes in drawn:
        log_axis(axes.yaxis, "", axes.get_ylim())
    drawn[0].set_ylabel(what)
    return figure


def _rows(panels: Mapping[str, list[Curve]], what: str, n: int) -> Figure:
    rows = rows_of([line for curves in panels.values() for line in curves])
    figure = canvas(9.6 if len(panels) > 1 else 7.2, rows_height(rows) + 1.0)
    for axes, curves in zip(
        figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels.values(), strict=True
    ):
        axes.axvline(1, color=FAINT, linestyle="-.", linewidth=1.2, zorder=1)
        draw_rows(axes, curves, rows, "")
        axes.set_xlabel(what)
    figure.suptitle(f"{plural(n, 'robot')}; $f_p$: parallel part of Amdahl's law, by Karp and Flatt")
    return figure


def _label(axes: Axes, n: float, value: float, text: str) -> None:
    line = {"arrowstyle": "-", "color": _AMDAHL, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0}
    place: dict[str, Any] = {"xytext": (14, 0), "textcoords": "offset points", "va": "center", "annotation_clip": False}
    axes.annotate(text, (n, value), color="#6e6e6e", fontsize=8, arrowprops=line, **place)


def _keep_apart(axes: Axes) -> None:
    labels = [text for text in axes.texts if isinstance(text, Annotation)]
    heights = np.array([axes.transData.transform(label.xy)[1] for label in labels]) * 72 / axes.figure.dpi
    for label, shift in zip(labels, spread(heights, _LABEL_GAP) - heights, strict=True):
        label.set_position((14, shift))
