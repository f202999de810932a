"""The paper's figure 9: the time a whole trajectory takes, over the number of robots."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mp2a.exceptions import InputError
from mp2a.network import EmulatedNetwork
from mp2a.plot.style import (
    FAINT,
    INK,
    LOOKS,
    PAPER_ROBOTS,
    PAPER_SAMPLES,
    Dashes,
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

GRAINS = ("batch", "single")
SOURCES = ("measured", "modelled", "extrapolated")
PAPER = {
    "kogge-stone": (0.152, Look("paper: MP²A, 0.152 s at n = 512", INK, "*")),
    "serial": (6.4, Look("paper: O(n), 6.4 s at n = 512", INK, "P")),
}
_ALONE = ("pinocchio",)  # runs in one process, so it never shares a core with other ranks
_LINES: dict[str, Dashes] = {"measured": "-", "modelled": (0, (5, 2)), "extrapolated": (0, (1, 1.5))}
_MARKS = {"modelled": "+", "extrapolated": "x"}
_TITLES = {
    "measured": "measured, wall clock",
    "modelled": "modelled, eq. 13",
    "extrapolated": "extrapolated, a core a robot",
}


class Series(NamedTuple):
    """One curve of the results: seconds per sample over the number of robots."""

    n: np.ndarray
    seconds: np.ndarray
    oversubscribed: np.ndarray


def runs(results: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """List the runs of a results file, one for each number of robots.

    Parameters
    ----------
    results : mapping
        A results file, parsed.

    Returns
    -------
    list of mapping
        By rising n; of several runs of one n the last. Only those over the network of the last run.
    """
    found = results.get("runs") if isinstance(results, Mapping) else None
    if not isinstance(found, list) or not found:
        raise InputError(f"results: got {_kind(results)} without runs, expected a results file with at least one run")
    for run in found:
        n = run.get("n") if isinstance(run, Mapping) else None
        if not isinstance(n, int) or n < 1:
            raise InputError(f"results: got a run with n = {n!r}, expected a whole number of robots, at least 1")
    alike = [run for run in found if run.get("emulated") == found[-1].get("emulated")]
    return [run for _, run in sorted({run["n"]: run for run in alike}.items())]


def series(results: Mapping[str, Any], source: str, contender: str, grain: str) -> Series:
    """Take one curve out of the results.

    Parameters
    ----------
    results : mapping
        A results file, parsed.
    source : {"measured", "modelled", "extrapolated"}
        Where its times come from; measured ones are wall clock.
    contender : str
        Whose times.
    grain : {"batch", "single"}
        Whether all samples travel in each message, or one at a time.

    Returns
    -------
    Series
        Where the results hold a time; runs without are left out.
    """
    rows = []
    for run in runs(results):
        cell = ((run.get(source) or {}).get(contender) or {}).get(grain)
        seconds = cell.get("wall") if isinstance(cell, Mapping) else cell
        if seconds is None or (source == "modelled" and seconds == 0):
            continue  # one robot alone sends nothing, and a logarithm has no place for that
        if not isinstance(seconds, int | float) or not 0 < seconds < np.inf:
            where = f"{source} {contender}, {grain}, n = {run['n']}"
            raise InputError(f"results: got {seconds!r} for {where}, expected seconds above 0")
        shared = source == "measured" and contender not in _ALONE and bool(run.get("oversubscribed"))
        rows.append((run["n"], seconds, shared))
    return Series(
        np.array([n for n, _, _ in rows], dtype=int),
        np.array([seconds for _, seconds, _ in rows], dtype=float),
        np.array([shared for _, _, shared in rows], dtype=bool),
    )


def contenders(results: Mapping[str, Any], source: str) -> list[str]:
    """List who has times of one kind, the known ones first.

    Parameters
    ----------
    results : mapping
        A results file, parsed.
    source : {"measured", "modelled", "extrapolated"}
        Kind of times.

    Returns
    -------
    list of str
        Names with at least one time.
    """
    held = {name for run in runs(results) for name, cell in (run.get(source) or {}).items() if cell}
    names = [name for name in LOOKS if name in held] + sorted(held - LOOKS.keys())
    return [name for name in names if any(len(series(results, source, name, grain).n) for grain in GRAINS)]


def samples(results: Mapping[str, Any]) -> int:
    """Tell how many samples the trajectory has; of several lengths the longest.

    Parameters
    ----------
    results : mapping
        A results file, parsed.

    Returns
    -------
    int
        Samples.
    """
    longest = 0
    for run in runs(results):
        count = run.get("samples")
        if not isinstance(count, int) or count < 1:
            raise InputError(f"results: got a run of {count!r} samples, expected at least 1")
        longest = max(longest, count)
    return longest


def grain_title(results: Mapping[str, Any], grain: str) -> str:
    """Name the way samples travel, as the title of a panel.

    Parameters
    ----------
    results : mapping
        A results file, parsed.
    grain : {"batch", "single"}
        Which way.

    Returns
    -------
    str
        For instance "2000 samples in each message".
    """
    emulated = runs(results)[-1].get("emulated")
    network = f",\nemulated network of {EmulatedNetwork(*emulated)}" if emulated else ""
    if grain == "single":
        return f"one sample at a time{network}"
    return f"{samples(results)} sample{'s' * (samples(results) > 1)} in each message{network}"


def hollow_note(results: Mapping[str, Any]) -> Artist | None:
    """Say in a legend what a hollow marker means.

    Parameters
    ----------
    results : mapping
        A results file, parsed.

    Returns
    -------
    Artist or None
        Nothing where no run had more ranks than cores.
    """
    crowded = [run for run in runs(results) if run.get("oversubscribed")]
    if not crowded:
        return None
    machine = results.get("machine") or {}
    cores = sorted({c for c in (run.get("cores", machine.get("cores")) for run in crowded) if c is not None})
    known = " or ".join(map(str, cores))
    few = f"the {known} core{'s' * (cores != [1])}" if cores else "cores"
    return handle(Look(f"hollow: more ranks than {few}", INK, "o"), "none", hollow=True, markeredgewidth=1.2)


def time_figure(results: Mapping[str, Any], period: float = 0.01) -> Figure:
    """Draw the time of the whole trajectory over the number of robots, as the paper's figure 9.

    Parameters
    ----------
    results : mapping
        A results file, parsed.
    period : float
        Control period in seconds: below samples × period the formation is computed in real time.

    Returns
    -------
    Figure
        Two panels; every curve carries its name as gid, "measured kogge-stone" for instance.

    Raises
    ------
    InputError
        For results without runs, or a period that is no time.
    """
    if not isinstance(period, int | float) or not 0 < period < np.inf:
        raise InputError(f"period: got {period!r}, expected seconds above 0")
    count = samples(results)
    found = {source: contenders(results, source) for source in SOURCES}
    if not any(found.values()):
        raise InputError("results: got runs without a single time, expected measured, modelled or extrapolated times")
    figure = canvas(9.6, 4.4)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, grain in zip(panels, GRAINS, strict=True):
        _panel(axes, results, grain, period)
    panels[0].set_ylabel(f"time for the whole trajectory, {count} sample{'s' * (count > 1)}")
    right = panels[1].secondary_yaxis("right", functions=(lambda t: t / count, lambda t: t * count))
    seconds_axis(right)
    _grid_of(right, panels[1], count)
    right.set_ylabel("time per sample")
    groups = [(_TITLES[s], [handle(_shape(s, who), _LINES[s]) for who in found[s]]) for s in SOURCES]
    scaled = "" if count == PAPER_SAMPLES else f", for {count} of its {PAPER_SAMPLES} samples"
    papers = [mark._replace(label=mark.label + scaled) for _, mark in PAPER.values()]
    marks = [handle(mark, "none", markersize=8, markeredgewidth=0) for mark in papers]
    real = handle(Look(f"real time at a control period of {period * 1e3:g} ms", FAINT, ""), "-.")
    note = hollow_note(results)
    legends(figure, [*groups, ("for comparison", [*marks, real, *([note] if note else [])])])
    return figure


time = picture(time_figure)


def _panel(axes: Axes, results: Mapping[str, Any], grain: str, period: float) -> None:
    count = samples(results)
    for source in SOURCES:
        for who in contenders(results, source):
            line = series(results, source, who, grain)
            name = f"{source} {who}"
            curve(axes, line.n, line.seconds * count, _shape(source, who), _LINES[source], line.oversubscribed, name)
    for who, (seconds, mark) in PAPER.items():
        axes.plot(
            PAPER_ROBOTS,
            seconds * count / PAPER_SAMPLES,
            linestyle="none",
            marker=mark.marker,
            color=mark.color,
            markersize=9,
            markeredgewidth=0,
            zorder=6,
            gid=f"paper {who}",
        )
    axes.axhline(count * period, color=FAINT, linestyle="-.", linewidth=1.2, gid="real time")
    robots_axis(axes, max(PAPER_ROBOTS, runs(results)[-1]["n"]))
    seconds_axis(axes)
    axes.set_title(grain_title(results, grain))


def _grid_of(right: Axes, axes: Axes, count: int) -> None:
    """Move a panel's horizontal grid to the labels on its right, seconds of a sample."""
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", left=False)
    low, high = axes.get_ylim()
    for place in right.get_yticks() * count:
        if low < place < high:
            axes.axhline(place, color=rcParams["grid.color"], linewidth=rcParams["grid.linewidth"], zorder=0.5)


def _shape(source: str, contender: str) -> Look:
    shape = look(contender)
    return shape if source == "measured" else shape._replace(marker=_MARKS[source])


def _kind(results: object) -> str:
    return "a file" if isinstance(results, Mapping) else type(results).__name__
