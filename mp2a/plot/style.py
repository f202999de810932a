"""What all pictures share: fonts, axes, curves and legends, and how a picture becomes a file."""

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter, FixedFormatter, FixedLocator, LogLocator, NullFormatter, NullLocator

from mp2a.exceptions import InputError
from mp2a.files import atomic_write, check_writable
from mp2a.plot.looks import FAINT, INK, Look

Dashes = str | tuple[float, tuple[float, ...]]
"""What matplotlib takes for a line style."""

_DPI = 200
_SUFFIXES = (".png", ".svg", ".pdf")
_WITHOUT_DATE: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {}}
_EDGE = 0.005  # of a figure's width, left free beside its legends
_LEGEND_GAP = 0.05  # of a figure's width, between groups at most
_MOST_TICKS = 14
_LARGE = ("*", "P")  # markers of what is compared with
_NARROW = 2.5
"""Decades of an axis of times up to which 2 and 5 have ticks as well."""
_STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.color": "#666666",
    "ytick.color": "#666666",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "figure.titlesize": 10,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.5,
    "legend.title_fontsize": 8.5,
    "legend.frameon": False,
    "hatch.linewidth": 0.5,
    "svg.hashsalt": "mp2a",
    "pdf.fonttype": 42,
}


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Draw in the style of this module, whatever the user's own settings, which come back afterwards.

    It decorates every function that makes a figure.
    """
    with matplotlib.style.context(["default", _STYLE]):
        yield


def check_picture(path: str | Path, suffixes: Sequence[str] = _SUFFIXES) -> Path:
    """Find out before a picture is drawn whether it can be written.

    Parameters
    ----------
    path
        Where it shall go; its folder is created.
    suffixes
        The endings of the kinds of file it can become.

    Returns
    -------
    Path
        The same.

    Raises
    ------
    InputError
        If its name has another ending.
    OutputError
        If it cannot be written there.
    """
    out = Path(path)
    if out.suffix.lower() not in suffixes:
        raise InputError(f"path: got '{out.name}', expected a name that ends in {', '.join(suffixes)}")
    check_writable(out)
    return out


@styled()
def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure to a file, the same bytes for the same figure.

    Parameters
    ----------
    figure
        Any of those that this package makes.
    path
        Where it goes; the ending .png, .svg or .pdf says what it becomes. Its folder is created.

    Returns
    -------
    Path
        The same.

    Raises
    ------
    InputError
        If its name has another ending.
    OutputError
        If it cannot be written, to a full or read-only disk for instance; an older picture is still there then.
    """
    out = check_picture(path)
    suffix = out.suffix.lower()
    with atomic_write(out) as new:
        figure.savefig(new, format=suffix[1:], dpi=_DPI, metadata=_WITHOUT_DATE[suffix], facecolor="white")
    return out


def canvas(width: float, height: float) -> Figure:
    """Make an empty figure that no window list of pyplot knows of, laid out so that nothing is cut off.

    Parameters
    ----------
    width, height
        Its size in inches.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def robots_axis(axes: Axes, sizes: Iterable[int]) -> None:
    """Make x the number of robots, a logarithm to base 2 that ends where the data end.

    Parameters
    ----------
    axes
        Whose x axis.
    sizes
        The numbers of robots that have points; as many of them get a tick as there is room for.
    """
    places = np.unique(list(sizes))
    low, high = np.log2(places[[0, -1]])
    ticks: list[int] = []
    for n in places[::-1]:
        if not ticks or np.log2(ticks[-1] / n) >= (high - low) / _MOST_TICKS:
            ticks.append(int(n))
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_major_formatter(FixedFormatter([str(n) for n in ticks]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    margin = 0.04 * (high - low) or 1.0
    axes.set_xlim(2 ** (low - margin), 2 ** (high + margin))
    axes.set_xlabel("number of robots n")
    axes.grid(True, which="major")


def log_axis(axis: Axis, unit: str, limits: tuple[float, float]) -> None:
    """Mark an axis that is logarithmic, at powers of ten or closer; call it once all is drawn.

    Parameters
    ----------
    axis
        The x or y axis of a panel.
    unit
        Of its ticks, with prefixes; "" for plain numbers.
    limits
        The least and largest value that is shown.
    """
    narrow = np.log10(limits[1] / limits[0]) < _NARROW
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,), numticks=12))
    axis.set_major_formatter(EngFormatter(unit) if unit else PLAIN)
    axis.set_minor_formatter(NullFormatter())
    axis.set_tick_params(which="minor", size=0)


PLAIN = matplotlib.ticker.StrMethodFormatter("{x:g}")
"""Numbers as they are."""


def curve(
    axes: Axes,
    x: np.ndarray,
    y: np.ndarray,
    shape: Look,
    line: Dashes = "-",
    hollow: np.ndarray | None = None,
    gid: str | None = None,
) -> Line2D:
    """Draw points, filled or hollow, with a line through them.

    Parameters
    ----------
    axes
        Where.
    x, y
        The points.
    shape
        The colour and marker.
    line
        Solid, dashed, dotted or "none".
    hollow
        Which points are not to be filled; None: none.
    gid
        Name of the line, for whoever looks for it in the figure or in an SVG.

    Returns
    -------
    Line2D
        The line, with all points.
    """
    plain: dict[str, Any] = {"color": shape.color, "marker": shape.marker, "markersize": _marker_size(shape)}
    [drawn] = axes.plot(x, y, linewidth=1.5, **plain)
    drawn.set(linestyle=line, label=shape.label, gid=gid, zorder=6 if shape.marker in _LARGE else 4)
    if hollow is not None and hollow.any():
        empty: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 1.2, "zorder": 5}
        axes.plot(x[hollow], y[hollow], linestyle="none", **plain, **empty)
    return drawn


def handle(shape: Look, line: Dashes = "-", hollow: bool = False, **more: Any) -> Line2D:
    """Make the sample of a curve that stands in a legend.

    Parameters
    ----------
    shape
        The label, colour and marker.
    line
        Its line style.
    hollow
        Whether the marker is empty.
    **more
        Anything else that a line takes.
    """
    inside = "white" if hollow else shape.color
    drawn = Line2D([], [], color=shape.color, marker=shape.marker, linewidth=1.5, markerfacecolor=inside)
    drawn.set(linestyle=line, label=shape.label, markersize=_marker_size(shape))
    drawn.set(**more)
    return drawn


def _marker_size(shape: Look) -> float:
    return 9 if shape.marker in _LARGE else 5


def remark(text: str) -> Line2D:
    """Make an entry of a legend that is only text."""
    return handle(Look(text, FAINT, ""), "none")


def legends(figure: Figure, groups: Sequence[tuple[str, Sequence[Artist]]], note: str = "") -> None:
    """Put titled groups of a legend under the panels, which keep their height: the figure grows.

    Parameters
    ----------
    figure
        Whose panels make room.
    groups
        Titles and handles; an empty group is left out. They stand side by side as far as the figure is wide enough,
        long ones in columns.
    note
        A line below them: where the data come from.
    """
    wide, tall = figure.get_size_inches()
    drawn = _side_by_side(figure, [(title, list(handles)) for title, handles in groups if handles])
    widths, heights = np.array([_size(figure, group) for group in drawn]).T / [[wide], [1]]
    gap = min(_LEGEND_GAP, max((1 - 2 * _EDGE - widths.sum()) / max(1, len(drawn) - 1), 2 * _EDGE))
    x, y, below = _EDGE, 0.0, 0.0
    places = []
    for width, height in zip(widths, heights, strict=True):
        if x > _EDGE and x + width > 1 - _EDGE + 1e-6:
            x, y = _EDGE, below
        places.append((x, y))
        x, below = x + width + gap, max(below, y + height)
    foot = (
        figure.text(_EDGE + 0.006, 0.0, note, color=FAINT, fontsize=8, va="bottom", in_layout=False) if note else None
    )
    room = below + (_size(figure, foot)[1] + 0.06 if foot else 0.0)
    figure.set_figheight(tall + room)
    share = 1 / (tall + room)
    figure.get_layout_engine().set(rect=(0, room * share, 1, tall * share))  # type: ignore[union-attr,call-arg]
    for group, (left, top) in zip(drawn, places, strict=True):
        group.set_bbox_to_anchor((left, (room - top) * share))
    if foot:
        foot.set_y(0.05 * share)


def _side_by_side(figure: Figure, groups: Sequence[tuple[str, list[Artist]]]) -> list[Legend]:
    """Make the groups with as few rows as fit side by side, or each in one column where that is too wide as well."""
    longest = max((len(handles) for _, handles in groups), default=0)
    for rows in range(min(4, longest), longest + 1):
        drawn = [_group(figure, title, handles, -(-len(handles) // rows)) for title, handles in groups]
        widths = sum(_size(figure, group)[0] for group in drawn)
        if rows == longest or widths <= (1 - 2 * _EDGE) * figure.get_figwidth() - 0.1 * (len(drawn) - 1):
            break
        for group in drawn:
            group.remove()
    return drawn


def _group(figure: Figure, title: str, handles: list[Artist], columns: int) -> Legend:
    keys: dict[str, Any] = {"loc": "upper left", "alignment": "left", "handlelength": 2.4, "borderaxespad": 0.2}
    group = figure.legend(handles=handles, title=title, ncols=columns, columnspacing=1.4, **keys)
    group.get_title().set_fontweight("bold")
    group.set_in_layout(False)
    return group


def _size(figure: Figure, artist: Any) -> tuple[float, float]:
    """Width and height of a text or legend in inches, which it has once it has been laid out."""
    box = artist.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    return box.width / figure.dpi, box.height / figure.dpi


def spread(places: Iterable[float], gap: float) -> np.ndarray:
    """Move places as little as it takes to be a gap apart, in their order.

    Parameters
    ----------
    places
        Where labels would like to be.
    gap
        The least distance of two neighbours.

    Returns
    -------
    ndarray
        Where they go: a least-squares fit, so a crowd stays centred on where it was.
    """
    wanted = np.asarray(list(places), dtype=float)
    order = np.argsort(wanted, kind="stable")
    crowds: list[tuple[float, int]] = []  # mean of (place - k gap), and how many
    for k, i in enumerate(order):
        mean, count = wanted[i] - k * gap, 1
        while crowds and crowds[-1][0] >= mean:
            before, many = crowds.pop()
            mean, count = (before * many + mean * count) / (many + count), many + count
        crowds.append((mean, count))
    out = np.empty_like(wanted)
    out[order] = np.concatenate([[m] * c for m, c in crowds] or [[]]) + gap * np.arange(len(order))
    return out
