"""The paths of a march over its world, with the robots as they stood on the way."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mp2a.exceptions import InputError
from mp2a.plot.style import FAINT, INK, canvas, legends, picture
from mp2a.simulator.events import RobotEvent
from mp2a.simulator.recording import Recording
from mp2a.simulator.world import World, rectangles
from mp2a.spatial import Array

FEW = 8
"""Robots that can each have a colour and a line in the legend."""

EVENT: dict[str, Any] = {
    "linestyle": "none",
    "marker": "X",
    "markersize": 7,
    "color": "#d4002a",
    "markeredgecolor": "white",
    "zorder": 7,
}
"""How a collision or another event is marked."""

_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8A6D3B", "#999999")
_STANDS = 7  # at how many times robots are drawn
_MARGIN = 1.0  # m around what is shown
_WIDTH, _TALLEST, _FLATTEST = 6.6, 6.6, 1.9  # inches


class View(NamedTuple):
    """Part of the ground that is shown, m."""

    left: float
    right: float
    bottom: float
    top: float


def march_figure(recording: Recording) -> Figure:
    """Draw the paths of all robots over the world, with their outlines at equal times from start to end.

    Parameters
    ----------
    recording : Recording
        A run.

    Returns
    -------
    Figure
        One panel; path i carries the gid ``path i``, counted from 1.

    Raises
    ------
    InputError
        For a recording of fewer than two times.
    """
    check(recording)
    figure, axes = ground(recording)
    n = len(recording.models)
    colors = robot_colors(n)
    for i, color in enumerate(colors):
        axes.plot(*recording.poses[:, i, :2].T, color=color, linewidth=1.1, zorder=3, gid=f"path {i + 1}")
    ticks = np.linspace(0, len(recording.times) - 1, _STANDS if n <= FEW else 3).round().astype(int)
    for order, k in enumerate(ticks):
        last = order == len(ticks) - 1
        bodies, noses = outlines(recording, int(k))
        inside = [to_rgba(color, 0.9 if last else 0.06) for color in colors]
        edges = [INK] * n if last else [to_rgba(color, 0.6) for color in colors]
        thin = 0.4 if n > FEW else 0.7
        axes.add_collection(
            PolyCollection(bodies, facecolors=inside, edgecolors=edges, linewidths=thin, zorder=4 + last)
        )
        axes.add_collection(LineCollection(noses, colors=edges, linewidths=thin, zorder=4 + last))
    axes.plot(*places(recording.events).T, **EVENT)
    shades: list[Artist] = [
        Patch(
            facecolor=to_rgba(FAINT, 0.06),
            edgecolor=FAINT,
            label=f"every {np.ptp(recording.times) / (len(ticks) - 1):.3g} s",
        ),
        Patch(facecolor=FAINT, edgecolor=INK, label="at the end"),
    ]
    if recording.events:
        shades.append(Line2D([], [], **EVENT, label="collision or other event"))
    legends(figure, [("robot", robot_handles(n)), ("outline", shades)])
    return figure


march = picture(march_figure)


def ground(recording: Recording) -> tuple[Figure, Axes]:
    """Make a figure of the ground with the world on it, in scale.

    Parameters
    ----------
    recording : Recording
        A run.

    Returns
    -------
    Figure, Axes
        The figure and its panel.
    """
    view = seen(recording)
    wide, tall = view.right - view.left, view.top - view.bottom
    figure = canvas(_WIDTH, float(np.clip(_WIDTH * tall / wide, _FLATTEST, _TALLEST)) + 0.4)
    axes = figure.add_subplot()
    draw_world(axes, recording.world)
    axes.set_aspect("equal")
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.grid(True)
    axes.set_title(title(recording), loc="left")
    return figure, axes


def title(recording: Recording) -> str:
    """Say how many robots drove where, and for how long."""
    n = len(recording.models)
    parts = [f"{n} robot{'s' * (n > 1)}", recording.world.name, f"{np.ptp(recording.times):.3g} s simulated"]
    return ", ".join(part for part in parts if part)


def check(recording: Recording) -> None:
    """Raise InputError for a recording in which nothing can have moved."""
    if len(recording.times) < 2:
        raise InputError(f"recording: got {len(recording.times)} times, expected at least two")


def seen(recording: Recording) -> View:
    """Choose what to show: the paths, and the world as far as it is not much larger than they are."""
    bodies = recording.poses[..., :2].reshape(-1, 2)
    low, high = bodies.min(axis=0) - _MARGIN, bodies.max(axis=0) + _MARGIN
    if len(recording.world.segments):
        ends = recording.world.segments.reshape(-1, 2)
        around = (high - low).max() / 2 + 2 * _MARGIN
        low = np.minimum(low, np.maximum(ends.min(axis=0) - 0.3, low - around))
        high = np.maximum(high, np.minimum(ends.max(axis=0) + 0.3, high + around))
    return View(*map(float, (low[0], high[0], low[1], high[1])))


def draw_world(axes: Axes, world: World) -> None:
    """Draw walls as lines and obstacles as areas."""
    axes.add_collection(LineCollection(world.walls, colors=INK, linewidths=1.6, zorder=2, gid="walls"))
    solid = PolyCollection(world.obstacles, facecolors="#c9c4bb", edgecolors=INK, linewidths=1.0, zorder=2)
    solid.set_gid("obstacles")
    axes.add_collection(solid)


def outlines(recording: Recording, tick: int) -> tuple[list[Array], list[Array]]:
    """Robots at a tick: corners ``(4, 2)`` of each, and a line ``(2, 2)`` that ends at the middle of its front."""
    poses = recording.poses[tick]
    lengths, widths = np.array([(model.length, model.width) for model in recording.models]).T
    ahead = np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=-1) * lengths[:, None] / 2
    noses = poses[:, None, :2] + ahead[:, None] * np.array([[0.5], [1.0]])
    return list(rectangles(poses, lengths, widths)), list(noses)


def places(events: Sequence[RobotEvent]) -> Array:
    """Where events happened, ``(k, 2)`` m."""
    return np.array([event.place for event in events]).reshape(-1, 2)


def robot_colors(n: int) -> list[str]:
    """Colours of n robots: far apart for a few (Okabe and Ito), a scale from the first to the last for many."""
    if n <= FEW:
        return list(_COLORS[:n])
    return [to_hex(color) for color in colormaps["viridis"](np.linspace(0, 0.93, n))]


def robot_handles(n: int) -> list[Artist]:
    """Lines of a legend that tell the robots apart: all of a few, some of many."""
    shown = range(n) if n <= FEW else np.linspace(0, n - 1, 5).round().astype(int)
    colors = robot_colors(n)
    return [Line2D([], [], color=colors[i], linewidth=2.5, label=f"{i + 1}") for i in shown]
