"""Curves over the number of robots: lines where there are several numbers, a row for each curve where there is one."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.ticker import EngFormatter

from mp2a.plot.looks import Look
from mp2a.plot.style import Dashes, curve, handle, log_axis, robots_axis

_ROW = 0.19  # inches
_BESIDE = 7  # points from a value to its number
_SHORTEST = 0.7  # decades that the values of a panel of rows are given at least


class Curve(NamedTuple):
    """Values over the number of robots."""

    gid: str
    """Its name in the figure."""
    group: str
    """Where its values come from; a heading in legends and among rows."""
    look: Look
    line: Dashes
    n: np.ndarray
    values: np.ndarray
    hollow: np.ndarray
    numbers: Sequence[str] = ()
    """What stands beside each value where the curve is a row; empty: nothing."""


Row = tuple[str, str]
"""A group and a label in it; a group and "" is a heading."""


def robot_counts(curves: Sequence[Curve]) -> list[int]:
    """Return the numbers of robots that curves have values for."""
    return sorted({int(n) for line in curves for n in line.n})


def in_seconds(times: np.ndarray) -> list[str]:
    """Write times in s, ms, µs or ns, to three digits."""
    digits = EngFormatter("s")
    return [digits(float(f"{seconds:.3g}")) for seconds in times]


def legend_groups(curves: Sequence[Curve]) -> list[tuple[str, list[Artist]]]:
    """Return titles and entries of a legend that explains lines, each look of a group once."""
    groups: dict[str, dict[Look, Artist]] = {}
    for line in curves:
        groups.setdefault(line.group, {})[line.look] = handle(line.look, line.line)
    return [(group, list(handles.values())) for group, handles in groups.items()]


def draw_lines(axes: Axes, curves: Sequence[Curve], sizes: Sequence[int]) -> None:
    """Draw curves over the number of robots.

    Parameters
    ----------
    axes
        Where; its y axis becomes logarithmic.
    curves
        What.
    sizes
        The numbers of robots of all panels that share this x axis.
    """
    for line in curves:
        curve(axes, line.n, line.values, line.look, line.line, line.hollow, line.gid)
    robots_axis(axes, sizes)
    axes.set_yscale("log")


def rows_of(curves: Sequence[Curve]) -> dict[Row, float]:
    """Return at which y curves of one number of robots are drawn, from the top down, headings among them."""
    rows: dict[Row, float] = {}
    for group in dict.fromkeys(line.group for line in curves):
        labels = dict.fromkeys(line.look.label for line in curves if line.group == group)
        for label in ("", *labels):
            rows[group, label] = -float(len(rows)) - 0.4 * len({above for above, _ in rows if above != group})
    return rows


def rows_height(rows: Mapping[Row, float]) -> float:
    """Return how many inches rows take."""
    return _ROW * (2.0 - min(rows.values()))


def draw_rows(axes: Axes, curves: Sequence[Curve], rows: Mapping[Row, float], unit: str) -> None:
    """Draw curves of one number of robots as rows of points, with their values beside them.

    Parameters
    ----------
    axes
        Where; its x axis becomes logarithmic. References that are in it already are within its limits.
    curves
        What.
    rows
        Where each goes, as `rows_of` gives it for all panels that share the y axis.
    unit
        Of the values.
    """
    axes.set_xscale("log")
    numbers: list[Annotation] = []
    for line in curves:
        y = rows[line.group, line.look.label]
        curve(axes, line.values, np.full(len(line.n), y), line.look, "none", line.hollow, line.gid)
        for value, number in zip(line.values, line.numbers, strict=True):
            place: dict[str, Any] = {"xytext": (_BESIDE, 0), "textcoords": "offset points", "va": "center_baseline"}
            box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            beside = axes.annotate(number, (value, y), fontsize=8, annotation_clip=False, bbox=box, zorder=3, **place)
            beside.set(color=line.look.color, in_layout=False)
            numbers.append(beside)
    values = np.concatenate([np.ravel(drawn.get_xdata()) for drawn in axes.lines]).astype(float)
    low, high = np.log10([values.min(), values.max()])
    wide = max(high - low, _SHORTEST)
    low = low - 0.06 * wide
    limits = 10**low, 10 ** max(low + 1.12 * wide, _end_of_numbers(axes, numbers, low))
    axes.set_xlim(limits)
    log_axis(axes.xaxis, unit, limits)
    axes.set_ylim(min(rows.values()) - 0.7, 0.7)
    ticks = axes.set_yticks(list(rows.values()), [label or group for group, label in rows])
    for (_, label), tick in zip(rows, ticks, strict=True):
        tick.label1.set_fontweight("normal" if label else "bold")
        tick.gridline.set_visible(bool(label))
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(True, axis="x")


def _end_of_numbers(axes: Axes, numbers: Sequence[Annotation], low: float) -> float:
    """Return the logarithm at which an axis that begins at another must end for the numbers to lie within it."""
    renderer = axes.figure.canvas.get_renderer()  # type: ignore[attr-defined]
    pixel = 72 / axes.figure.dpi
    room = 0.95 * axes.bbox.width * pixel
    ends = []
    for number in numbers:
        beside = _BESIDE + number.get_window_extent(renderer).width * pixel + 4
        ends.append(low + (np.log10(number.xy[0]) - low) / max(1 - beside / room, 0.1))
    return max(ends, default=low)
