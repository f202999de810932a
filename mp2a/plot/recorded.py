"""What the pictures of a recording share: colours and names of robots, symbols of events, the ground with its world."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import ScaledTranslation

from mp2a.exceptions import InputError
from mp2a.plot.looks import FAINT, INK
from mp2a.plot.measurements import plural
from mp2a.plot.style import canvas
from mp2a.simulator.events import EventKind
from mp2a.simulator.recording import Recording
from mp2a.simulator.world import World, rectangles
from mp2a.spatial import Array

COLORS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8A6D3B", "#999999",
    "#332288", "#D9C84A", "#882255", "#8FD694", "#7B4FC9", "#F28E8C", "#3A5F0B", "#B8D4F0",
)  # fmt: skip
"""Of so many robots each has a colour of its own, the first eight those of Okabe and Ito."""
LEADER: dict[str, Any] = {"color": FAINT, "linestyle": (0, (6, 3)), "linewidth": 1.0}
"""How the path of a leader is drawn."""

_ALARM = "#d4002a"
_SYMBOLS = {
    EventKind.COLLISION: ("collision", "X", _ALARM, True),
    EventKind.ERROR_STATE: ("error state", "8", _ALARM, True),
    EventKind.CONTACT: ("obstacle inside its radius", "D", _ALARM, False),
    EventKind.STOP: ("stops: something in its way", "s", INK, True),
    EventKind.GO_ON: ("goes on", "s", INK, False),
    EventKind.CATCH_UP: ("far behind, catches up", ">", INK, True),
    EventKind.CAUGHT_UP: ("has caught up", ">", INK, False),
}
"""What legends call an event, its marker and colour, and whether it is filled: the end of a state is hollow."""
_SAMPLES = 5  # of many robots, in a legend
_MARGIN = 1.0  # m around what is shown
_WIDTH, _TALLEST, _FLATTEST = 6.6, 6.6, 1.5  # inches; width of the figure, height of its panel
_BESIDE, _ABOVE = 0.65, 0.75  # inches of labels and title beside and above a panel
_POINTS = 72  # an inch
_ROLE = 7  # points of the name of a robot


class View(NamedTuple):
    """Part of the ground that is shown, m."""

    left: float
    right: float
    bottom: float
    top: float


def check_recording(recording: Recording) -> None:
    """Raise InputError for a recording in which nothing can have moved."""
    if len(recording.times) < 2:
        raise InputError(f"recording: got {len(recording.times)} times, expected at least two")


def title(recording: Recording) -> str:
    """Return how many robots drove where, and for how long."""
    seconds = f"{np.ptp(recording.times):.3g} s simulated"
    parts = [plural(len(recording.models), "robot"), recording.world.name, seconds]
    return ", ".join(part for part in parts if part)


def robot_colors(n: int) -> list[str]:
    """Return the colours of n robots: as different as can be for a few, a scale from the first to the last for many."""
    if n <= len(COLORS):
        return list(COLORS[:n])
    return [to_hex(color) for color in colormaps["viridis"](np.linspace(0, 0.93, n))]


def robot_handles(recording: Recording) -> list[Artist]:
    """Return the entries of a legend that tell robots apart: all of a few, some of many."""
    n = len(recording.roles)
    shown = range(n) if n <= len(COLORS) else np.linspace(0, n - 1, _SAMPLES).round().astype(int)
    colors = robot_colors(n)
    return [Line2D([], [], color=colors[i], linewidth=2.5, label=recording.roles[i]) for i in shown]


def event_symbol(kind: EventKind) -> dict[str, Any]:
    """Return how an event of a kind is marked, as options of a line."""
    label, marker, color, filled = _SYMBOLS[kind]
    inside, edge, wide = (color, "white", 0.6) if filled else ("white", color, 1.1)
    return {
        "linestyle": "none", "marker": marker, "markersize": 8 if kind is EventKind.COLLISION else 6.5, "label": label,
        "markerfacecolor": inside, "markeredgecolor": edge, "markeredgewidth": wide, "zorder": 7,
    }  # fmt: skip


def event_kinds(recording: Recording) -> list[EventKind]:
    """Return the kinds of events that a recording has, the gravest first."""
    held = {event.kind for event in recording.events}
    return [kind for kind in _SYMBOLS if kind in held]


def event_handles(recording: Recording) -> list[Artist]:
    """Return the entries of a legend that explain the symbols of a recording's events."""
    return [Line2D([], [], **event_symbol(kind)) for kind in event_kinds(recording)]


def event_places(recording: Recording, kind: EventKind, until: float = np.inf) -> Array:
    """Return where events of a kind happened until a time, ``(k, 2)`` m."""
    return np.array([e.place for e in recording.events if e.kind is kind and e.time <= until]).reshape(-1, 2)


def leader_handles(recording: Recording) -> list[Artist]:
    """Return the entry of a legend that explains the path of the leader, if the recording has one."""
    return [Line2D([], [], label="path of the leader", **LEADER)] if recording.leader_paths else []


def ground(recording: Recording) -> tuple[Figure, Axes]:
    """Make a figure of the ground in scale, with the world and the leader's path on it.

    Parameters
    ----------
    recording
        A run.

    Returns
    -------
    Figure, Axes
        The figure and its panel.
    """
    view = _view(recording)
    shape = (view.top - view.bottom) / (view.right - view.left)
    figure = canvas(_WIDTH, float(np.clip((_WIDTH - _BESIDE) * shape, _FLATTEST, _TALLEST)) + _ABOVE)
    axes = figure.add_subplot()
    _draw_world(axes, recording.world)
    for line in recording.leader_paths:
        axes.plot(*line.T, zorder=2.5, gid="leader path", **LEADER)
    axes.set_aspect("equal")
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.grid(True)
    axes.set_title(title(recording), loc="left")
    return figure, axes


def outlines(recording: Recording, tick: int) -> tuple[list[Array], list[Array]]:
    """Return the outlines of the robots at a tick.

    Parameters
    ----------
    recording
        A run.
    tick
        Its row.

    Returns
    -------
    list of ndarray, list of ndarray
        Corners ``(4, 2)`` m of each robot, and a line ``(2, 2)`` m that ends at the middle of its front.
    """
    poses = recording.poses[tick]
    lengths, widths = np.array([(model.length, model.width) for model in recording.models]).T
    ahead = np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=-1) * lengths[:, None] / 2
    noses = poses[:, None, :2] + ahead[:, None] * np.array([[0.5], [1.0]])
    return list(rectangles(poses, lengths, widths)), list(noses)


def write_roles(axes: Axes, recording: Recording, tick: int) -> list[Text]:
    """Write the names of robots on them, or above them where they are small; of a dense crowd only some.

    Parameters
    ----------
    axes
        A panel of `ground`.
    recording
        A run.
    tick
        Its row, for which names are kept apart.

    Returns
    -------
    list of Text
        A text for each robot, at its place; of robots without a name it is empty.
    """
    left, right = axes.get_xlim()
    metre = _POINTS * (_WIDTH - _BESIDE) / (right - left)
    place = recording.poses[tick, :, :2] * metre
    lengths, widths = np.array([(model.length, model.width) for model in recording.models]).T * metre
    wide = max(map(len, recording.roles)) * 0.75 * _ROLE  # points that a name takes
    inside = bool(wide < widths.min())
    above = 0.0 if inside else float(np.hypot(lengths, widths).max()) / 2 + 1
    shift = axes.transData + ScaledTranslation(0, above / _POINTS, axes.figure.dpi_scale_trans)
    style: dict[str, Any] = {"fontsize": _ROLE, "fontweight": "bold", "color": INK, "ha": "center", "zorder": 8}
    written: list[int] = []
    out = []
    for i, (x, y) in enumerate(recording.poses[tick, :, :2]):
        free = (np.abs(place[written] - place[i]) > (wide, 1.1 * _ROLE)).any(axis=1).all()
        written += [i] if free else []
        text = axes.text(x, y, recording.roles[i] if free else "", transform=shift, **style)
        text.set(va="center" if inside else "bottom", path_effects=[withStroke(linewidth=1.5, foreground="white")])
        out.append(text)
    return out


def _view(recording: Recording) -> View:
    """Choose what to show: all paths, and the world as far as it is not much larger than they are."""
    bodies = np.concatenate([recording.poses[..., :2].reshape(-1, 2), *recording.leader_paths])
    low, high = np.nanmin(bodies, axis=0) - _MARGIN, np.nanmax(bodies, axis=0) + _MARGIN
    if len(recording.world.segments):
        ends = recording.world.segments.reshape(-1, 2)
        around = (high - low).max() / 2 + 2 * _MARGIN
        low = np.minimum(low, np.maximum(ends.min(axis=0) - 0.3, low - around))
        high = np.maximum(high, np.minimum(ends.max(axis=0) + 0.3, high + around))
    return View(*map(float, (low[0], high[0], low[1], high[1])))


def _draw_world(axes: Axes, world: World) -> None:
    """Draw walls as lines and obstacles as areas."""
    axes.add_collection(LineCollection(world.walls, colors=INK, linewidths=1.6, zorder=2, gid="walls"))
    solid = PolyCollection(world.obstacles, facecolors="#c9c4bb", edgecolors=INK, linewidths=1.0, zorder=2)
    solid.set_gid("obstacles")
    axes.add_collection(solid)
