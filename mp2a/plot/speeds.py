"""Commanded speeds and distances between neighbours over time: the thesis' figures 7.5 and 7.7."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mp2a.plot.march import FEW, check, robot_colors, robot_handles, title
from mp2a.plot.style import FAINT, INK, canvas, legends, picture
from mp2a.simulator.recording import Recording
from mp2a.spatial import Array

_WANTED: dict[str, Any] = {"linestyle": (0, (5, 2)), "linewidth": 0.7}
_DRIVEN_TOO = 3  # so many robots' real speeds fit in beside the commanded ones


def speeds_figure(recording: Recording) -> Figure:
    """Draw commanded speeds, turn rates and distances between neighbours over time.

    Parameters
    ----------
    recording : Recording
        A run.

    Returns
    -------
    Figure
        Panels for speed, turn rate, with more than one robot distances, and the distance to the virtual leader or the
        setpoint where there is one; lines carry gids such as ``speed 1``, ``turn rate 1`` and ``distance 1 2``, robots
        counted from 1.

    Raises
    ------
    InputError
        For a recording of fewer than two times.
    """
    check(recording)
    n = len(recording.models)
    led = bool(np.isfinite(recording.leaders).any())
    rows = 2 + (n > 1) + led
    figure = canvas(6.6, 1.75 * rows)
    panels: list[Axes] = list(figure.subplots(rows, 1, sharex=True))
    colors = robot_colors(n)
    thick = 1.3 if n <= FEW else 0.7
    for axes, column, name, unit in ((panels[0], 0, "speed", "m/s"), (panels[1], 1, "turn rate", "rad/s")):
        for i in range(n):
            given = axes.step(recording.times, recording.commands[:, i, column], where="post", linewidth=thick)
            given[0].set(color=colors[i], gid=f"{name} {i + 1}")
            if n <= _DRIVEN_TOO:
                driven = axes.plot(recording.times, recording.twists[:, i, column], linestyle=(0, (1, 1)), linewidth=1)
                driven[0].set(color=colors[i], alpha=0.8, gid=f"driven {name} {i + 1}")
        axes.set_ylabel(f"{name} ({unit})")
        axes.axhline(0, color=FAINT, linewidth=0.6)
    if n > 1:
        for i, distance in enumerate(distances(recording).T):
            [drawn] = panels[2].plot(recording.times, distance, color=colors[i + 1], linewidth=thick)
            drawn.set_gid(f"distance {i + 1} {i + 2}")
        panels[2].set_ylabel("distance to the\nrobot before (m)")
    if led:
        _leaders(panels[-1], recording, colors, thick)
    for event in recording.events:
        for axes in panels:
            axes.axvline(event.time, color="#d4002a", linewidth=0.8, linestyle=(0, (4, 2)))
    for axes in panels:
        axes.grid(True)
        axes.margins(x=0)
    panels[0].set_title(title(recording), loc="left")
    panels[-1].set_xlabel("time (s)")
    figure.align_ylabels()
    legends(figure, [("robot", robot_handles(n)), ("line", _lines(n, led, bool(recording.events)))])
    return figure


speeds = picture(speeds_figure)


def _leaders(axes: Axes, recording: Recording, colors: list[str], thick: float) -> None:
    """Draw how far each robot was from its leader or setpoint, and how far it was to be."""
    for i, color in enumerate(colors):
        [drawn] = axes.plot(recording.times, recording.gaps[:, i], color=color, linewidth=thick)
        drawn.set_gid(f"leader distance {i + 1}")
        [wanted] = axes.step(recording.times, recording.leaders[:, i, 2], color=color, where="post", **_WANTED)
        wanted.set_gid(f"wanted distance {i + 1}")
    what = "virtual leader" if np.nanmax(recording.leaders[..., 2]) > 0 else "setpoint"
    axes.set_ylabel(f"distance to the\n{what} (m)")


def distances(recording: Recording) -> Array:
    """Distances ``(T, n - 1)`` m between the middles of neighbours: robots 1 and 2, 2 and 3, and so on."""
    out: Array = np.linalg.norm(np.diff(recording.poses[..., :2], axis=1), axis=-1)
    return out


def _lines(n: int, led: bool, events: bool) -> list[Line2D]:
    out = [Line2D([], [], color=INK, label="commanded")]
    if n <= _DRIVEN_TOO:
        out.append(Line2D([], [], color=INK, linestyle=(0, (1, 1)), label="driven"))
    if led:
        out.append(Line2D([], [], color=INK, label="wanted distance", **_WANTED))
    if events:
        out.append(Line2D([], [], color="#d4002a", linestyle=(0, (4, 2)), label="collision or other event"))
    return out
