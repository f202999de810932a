"""What all pictures share: colours, markers, fonts, the axis of robots, and how a picture becomes a file."""

import contextlib
import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter, FixedFormatter, FixedLocator, LogLocator, NullFormatter, NullLocator

from mp2a.bench.contenders import (
    GATHER_SCATTER,
    GATHER_SCATTER_TREE,
    LABELS,
    PINOCCHIO,
    PIPELINE,
    PIPELINE_BLOCKS,
)
from mp2a.exceptions import InputError

Data = TypeVar("Data")
Options = ParamSpec("Options")
Dashes = str | tuple[float, tuple[float, ...]]  # what matplotlib takes for a line style


class Look(NamedTuple):
    """How one contender looks in every picture: the colours keep apart for colour-blind readers (Okabe and Ito)."""

    label: str
    color: str
    marker: str


INK = "#222222"
FAINT = "#8a8a8a"
LOOKS = {
    "kogge-stone": Look(LABELS["kogge-stone"], "#0072B2", "o"),
    "compact": Look(LABELS["compact"], "#56B4E9", "p"),
    "sweep": Look(LABELS["sweep"], "#000000", ">"),
    PIPELINE: Look(LABELS[PIPELINE], "#D55E00", "s"),
    PIPELINE_BLOCKS: Look(LABELS[PIPELINE_BLOCKS], "#E69F00", "s"),
    GATHER_SCATTER: Look(LABELS[GATHER_SCATTER], "#009E73", "D"),
    GATHER_SCATTER_TREE: Look(LABELS[GATHER_SCATTER_TREE], "#88CC66", "d"),
    PINOCCHIO: Look(LABELS[PINOCCHIO], "#AA4499", "^"),
    "serial": Look("serial O(n)", "#555555", "v"),
}
SUFFIXES = (".png", ".svg", ".pdf")
PAPER_ROBOTS = 512
PAPER_SAMPLES = 2000
_DPI = 200
_SPARE = ("#CC6677", "#332288", "#999933", "#88CCEE")
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
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.5,
    "legend.title_fontsize": 8.5,
    "legend.frameon": False,
    "hatch.linewidth": 0.5,
    "svg.hashsalt": "mp2a",
    "pdf.fonttype": 42,
}
_WITHOUT_DATE: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {}}


def look(contender: str) -> Look:
    """Tell how a contender is drawn; one this module has never heard of gets a colour of its own.

    Parameters
    ----------
    contender : str
        Its name in the results.

    Returns
    -------
    Look
        Label, colour and marker.
    """
    return LOOKS.get(contender) or Look(contender, _SPARE[sum(contender.encode()) % len(_SPARE)], "h")


def picture(
    figure: Callable[Concatenate[Data, Options], Figure],
) -> Callable[Concatenate[Data, str | Path, Options], Path]:
    """Make a function that writes what another one draws.

    Parameters
    ----------
    figure : Callable
        ``figure(data, **options)``.

    Returns
    -------
    Callable
        ``write(data, path, **options)``, which returns the path. Its ending is .png, .svg or .pdf, anything else an
        InputError before anything is drawn; its folder is created.
    """

    def write(data: Data, path: str | Path, /, *arguments: Options.args, **options: Options.kwargs) -> Path:
        out = target(path)
        with styled():
            return save(figure(data, *arguments, **options), out)

    write.__name__ = write.__qualname__ = figure.__name__.removesuffix("_figure")
    write.__module__ = figure.__module__
    told = f"Write what `{figure.__name__}` makes to ``path`` (.png, .svg or .pdf; its folder is created)."
    write.__doc__ = f"{told}\n\n{inspect.getdoc(figure)}"
    return write


def target(path: str | Path) -> Path:
    """Check that a picture can be written there, before any of it is drawn.

    Parameters
    ----------
    path : str or Path
        Where the picture shall go; its ending chooses the file type.

    Returns
    -------
    Path
        The same.
    """
    out = Path(path)
    if out.suffix.lower() not in SUFFIXES:
        raise InputError(f"path: got '{out.name}', expected a name that ends in {', '.join(SUFFIXES)}")
    return out


def save(figure: Figure, path: Path) -> Path:
    """Write a figure; its folder is created.

    Parameters
    ----------
    figure : Figure
        What to write.
    path : Path
        Where, as `target` gave it.

    Returns
    -------
    Path
        The file written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI, metadata=_WITHOUT_DATE[path.suffix.lower()], facecolor="white")
    return path


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Draw and save in this module's style, whatever the user's own settings; they come back afterwards."""
    with matplotlib.style.context(["default", _STYLE]):
        yield


def canvas(width: float, height: float) -> Figure:
    """Make an empty figure that no pyplot window list knows of.

    Parameters
    ----------
    width, height : float
        Its size in inches.

    Returns
    -------
    Figure
        With a canvas, laid out so that nothing is cut off.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def robots_axis(axes: Axes, largest: int, smallest: int = 1) -> None:
    """Make x the number of robots, a logarithm to base 2, marked at powers of two.

    Parameters
    ----------
    axes : Axes
        Whose x axis.
    largest, smallest : int
        Its ends.
    """
    axes.set_xscale("log", base=2)
    powers = 2 ** np.arange(0, int(np.ceil(np.log2(max(largest, 2)))) + 1)
    powers = powers[powers <= largest]
    powers = powers[:: -(-len(powers) // 11)]
    axes.xaxis.set_major_locator(FixedLocator(powers.tolist()))
    axes.xaxis.set_major_formatter(FixedFormatter([str(p) for p in powers]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(smallest / 1.2, largest * 1.2)
    axes.set_xlabel("number of robots n")
    axes.grid(True, which="major")


def seconds_axis(axes: Axes) -> None:
    """Make y times on a logarithmic scale, marked at powers of ten.

    Parameters
    ----------
    axes : Axes
        Whose y axis.
    """
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_major_formatter(EngFormatter("s"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(axis="y", which="minor", size=0)


def curve(
    axes: Axes,
    x: np.ndarray,
    y: np.ndarray,
    shape: Look,
    line: Dashes = "-",
    hollow: np.ndarray | None = None,
    gid: str | None = None,
) -> Line2D:
    """Draw measured points, filled or hollow, with a line through them.

    Parameters
    ----------
    axes : Axes
        Where.
    x, y : ndarray
        The points.
    shape : Look
        Colour and marker.
    line : str or tuple
        Solid, dashed or dotted.
    hollow : ndarray of bool, optional
        Which points are not to be filled.
    gid : str, optional
        Name of the line, for whoever looks for it in the figure or in an SVG.

    Returns
    -------
    Line2D
        The line, with all points.
    """
    [drawn] = axes.plot(x, y, color=shape.color, marker=shape.marker, markersize=5, linewidth=1.5)
    drawn.set(linestyle=line, label=shape.label, gid=gid, zorder=4)
    if hollow is not None and hollow.any():
        axes.plot(
            x[hollow],
            y[hollow],
            linestyle="none",
            color=shape.color,
            marker=shape.marker,
            markersize=5,
            markerfacecolor="white",
            markeredgewidth=1.2,
            zorder=5,
        )
    return drawn


def handle(shape: Look, line: Dashes = "-", hollow: bool = False, **more: Any) -> Line2D:
    """Make the sample of a curve that stands in a legend.

    Parameters
    ----------
    shape : Look
        Label, colour and marker.
    line : str or tuple
        Line style.
    hollow : bool
        Whether the marker is empty.
    **more : Any
        Anything else a line takes.

    Returns
    -------
    Line2D
        A line that is in no axes.
    """
    inside = "white" if hollow else shape.color
    drawn = Line2D([], [], color=shape.color, marker=shape.marker, markersize=5, linewidth=1.5, markerfacecolor=inside)
    drawn.set(linestyle=line, label=shape.label, **more)
    return drawn


def legends(figure: Figure, columns: Sequence[tuple[str, Sequence[Artist]]]) -> None:
    """Put titled groups of a legend side by side under the panels, which keep their height: the figure grows.

    Parameters
    ----------
    figure : Figure
        Whose panels make room.
    columns : sequence of (title, handles)
        The groups; an empty one is left out.
    """
    height = 0.3 + 0.17 * max(len(handles) for _, handles in columns)
    figure.set_figheight(figure.get_figheight() + height)
    share = height / figure.get_figheight()
    figure.get_layout_engine().set(rect=(0, share, 1, 1 - share))  # type: ignore[union-attr,call-arg]
    drawn = []
    for title, handles in columns:
        if handles:
            keys: dict[str, Any] = {"loc": "upper left", "alignment": "left", "handlelength": 2.4, "borderaxespad": 0.2}
            drawn.append(figure.legend(handles=list(handles), title=title, bbox_to_anchor=(0.005, share), **keys))
            drawn[-1].get_title().set_fontweight("bold")
            drawn[-1].set_in_layout(False)
    figure.draw_without_rendering()  # how wide a group is, is known only once it has been laid out
    widths = [group.get_window_extent().width / figure.bbox.width for group in drawn]
    gap = min(0.05, (0.99 - sum(widths)) / max(1, len(widths) - 1))
    for k, group in enumerate(drawn):
        group.set_bbox_to_anchor((0.005 + sum(widths[:k]) + k * gap, share))


def spread(places: Iterable[float], gap: float) -> np.ndarray:
    """Move places as little as it takes to be `gap` apart, in their order.

    Parameters
    ----------
    places : iterable of float
        Where labels would like to be.
    gap : float
        Least distance of two neighbours.

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
