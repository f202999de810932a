"""The paths of robots over their world, with the robots as they stood on the way."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from mp2a.plot.looks import FAINT, INK
from mp2a.plot.recorded import (
    check_recording,
    event_handles,
    event_kinds,
    event_places,
    event_symbol,
    ground,
    leader_handles,
    outlines,
    robot_colors,
    robot_handles,
    write_roles,
)
from mp2a.plot.style import legends, styled
from mp2a.simulator.recording import Recording

_FEW = 8  # robots whose outlines on the way do not hide each other
_STANDS = 7  # at how many times they are drawn


@styled()
def march_figure(recording: Recording) -> Figure:
    """Draw the paths of all robots over the world, with their outlines at equal times from start to end.

    Parameters
    ----------
    recording
        A run.

    Returns
    -------
    Figure
        One panel; path i carries the gid ``path i``, counted from 1, that of the leader ``leader path``, and events
        ``event collision`` and the like.

    Raises
    ------
    InputError
        For a recording of fewer than two times.
    """
    check_recording(recording)
    figure, axes = ground(recording)
    n = len(recording.models)
    colors = robot_colors(n)
    for i, color in enumerate(colors):
        axes.plot(*recording.poses[:, i, :2].T, color=color, linewidth=1.1, zorder=3, gid=f"path {i + 1}")
    ticks = np.linspace(0, len(recording.times) - 1, _STANDS if n <= _FEW else 3).round().astype(int)
    for order, k in enumerate(ticks):
        last = order == len(ticks) - 1
        bodies, noses = outlines(recording, int(k))
        inside = [to_rgba(color, 0.9 if last else 0.06) for color in colors]
        edges = [INK] * n if last else [to_rgba(color, 0.6) for color in colors]
        thin = 0.4 if n > _FEW else 0.7
        axes.add_collection(
            PolyCollection(bodies, facecolors=inside, edgecolors=edges, linewidths=thin, zorder=4 + last)
        )
        axes.add_collection(LineCollection(noses, colors=edges, linewidths=thin, zorder=4 + last))
    write_roles(axes, recording, -1)
    for kind in event_kinds(recording):
        axes.plot(*event_places(recording, kind).T, gid=f"event {kind.value}", **event_symbol(kind))
    every = f"every {np.ptp(recording.times) / (len(ticks) - 1):.3g} s"
    shades: list[Artist] = [
        Patch(facecolor=to_rgba(FAINT, 0.06), edgecolor=FAINT, label=every),
        Patch(facecolor=FAINT, edgecolor=INK, label="at the end"),
        *leader_handles(recording),
    ]
    legends(figure, [("robot", robot_handles(recording)), ("drawn", shades), ("event", event_handles(recording))])
    return figure
