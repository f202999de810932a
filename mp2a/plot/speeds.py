"""Commanded speeds and distances between neighbours over time: the thesis' figures 7.5 and 7.7."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mp2a.plot.looks import FAINT, INK
from mp2a.plot.recorded import check_recording, event_handles, event_symbol, robot_colors, robot_handles, title
from mp2a.plot.style import canvas, legends, styled
from mp2a.simulator.recording import Recording
from mp2a.spatial import Array

_WANTED: dict[str, Any] = {"linestyle": (0, (5, 2)), "linewidth": 0.7}
_DRIVEN_TOO = 3  # so many robots' real speeds fit in beside the commanded ones
_SYMBOL = 0.025  # of the time axis, that a symbol takes
_ROWS = 4  # of symbols of events at most, one above another
_FEW = 8  # robots whose lines may be thick
_LEAST = 0.02
"""m, m/s and rad/s that a panel spans at least, so that rounding does not fill it."""


@styled()
def speeds_figure(recording: Recording) -> Figure:
    """Draw commanded speeds, turn rates and distances between neighbours over time.

    Parameters
    ----------
    recording
        A run.

    Returns
    -------
    Figure
        Panels for speed, turn rate, with more than one robot distances, and the distance to the virtual leader or the
        setpoint where there is one; lines carry gids such as ``speed 1``, ``turn rate 1`` and ``distance 1 2``, robots
        counted from 1, and events ``event collision`` and the like.

    Raises
    ------
    InputError
        For a recording of fewer than two times.
    """
    check_recording(recording)
    n = len(recording.models)
    led = bool(np.isfinite(recording.leaders).any())
    rows = 2 + (n > 1) + led
    figure = canvas(6.6, 1.75 * rows)
    panels: list[Axes] = list(figure.subplots(rows, 1, sharex=True))
    colors = robot_colors(n)
    thick = 1.3 if n <= _FEW else 0.7
    for axes, column, name, unit in ((panels[0], 0, "speed", "m/s"), (panels[1], 1, "turn rate", "rad/s")):
        for i in range(n):
            commanded = axes.step(recording.times, recording.commands[:, i, column], where="post", linewidth=thick)
            commanded[0].set(color=colors[i], gid=f"{name} {i + 1}")
            if n <= _DRIVEN_TOO:
                driven = axes.plot(recording.times, recording.twists[:, i, column], linestyle=(0, (1, 1)), linewidth=1)
                driven[0].set(color=colors[i], alpha=0.8, gid=f"driven {name} {i + 1}")
        axes.set_ylabel(f"{name} ({unit})")
        axes.axhline(0, color=FAINT, linewidth=0.6)
    if n > 1:
        for i, distance in enumerate(neighbour_distances(recording).T):
            [drawn] = panels[2].plot(recording.times, distance, color=colors[i + 1], linewidth=thick)
            drawn.set_gid(f"distance {i + 1} {i + 2}")
        panels[2].set_ylabel("distance to the\nrobot before (m)")
    if led:
        _leaders(panels[-1], recording, colors, thick)
    for axes in panels:
        axes.grid(True)
        axes.margins(x=0)
        low, high = axes.get_ylim()
        if high - low < _LEAST:
            axes.set_ylim((low + high - _LEAST) / 2, (low + high + _LEAST) / 2)
    above = _events(panels, recording, colors)
    panels[0].set_title(title(recording), loc="left", pad=6 + 8 * above)
    panels[-1].set_xlabel("time (s)")
    figure.align_ylabels()
    groups = [("robot", robot_handles(recording)), ("line", _lines(n, led)), ("event", event_handles(recording))]
    legends(figure, groups)
    return figure


def neighbour_distances(recording: Recording) -> Array:
    """Return the distances ``(T, n - 1)`` m between the middles of robots 1 and 2, 2 and 3, and so on."""
    out: Array = np.linalg.norm(np.diff(recording.poses[..., :2], axis=1), axis=-1)
    return out


def _leaders(axes: Axes, recording: Recording, colors: list[str], thick: float) -> None:
    """Draw how far each robot was from its leader or setpoint, and how far it was to be."""
    for i, color in enumerate(colors):
        [drawn] = axes.plot(recording.times, recording.gaps[:, i], color=color, linewidth=thick)
        drawn.set_gid(f"leader distance {i + 1}")
        [wanted] = axes.step(recording.times, recording.leaders[:, i, 2], color=color, where="post", **_WANTED)
        wanted.set_gid(f"wanted distance {i + 1}")
    what = "virtual leader" if np.nanmax(recording.leaders[..., 2]) > 0 else "setpoint"
    axes.set_ylabel(f"distance to the\n{what} (m)")


def _events(panels: list[Axes], recording: Recording, colors: list[str]) -> int:
    """Mark events by lines in the robots' colours and symbols above the first panel; return how many rows of them."""
    near = _SYMBOL * np.ptp(recording.times)
    ends: list[float] = []  # of the rows of symbols, from the lowest
    for event in recording.events:
        for axes in panels:
            axes.axvline(event.time, color=colors[event.robot], linewidth=0.7, alpha=0.6, zorder=1)
        row = next((k for k, end in enumerate(ends) if event.time >= end), min(len(ends), _ROWS - 1))
        ends[row : row + 1] = [event.time + near]
        place = 1.05 + 0.08 * row
        above = panels[0].plot(event.time, place, transform=panels[0].get_xaxis_transform(), **event_symbol(event.kind))
        above[0].set(clip_on=False, gid=f"event {event.kind.value}")
    return len(ends)


def _lines(n: int, led: bool) -> list[Artist]:
    out: list[Artist] = [Line2D([], [], color=INK, label="commanded")]
    if n <= _DRIVEN_TOO:
        out.append(Line2D([], [], color=INK, linestyle=(0, (1, 1)), label="driven"))
    if led:
        out.append(Line2D([], [], color=INK, label="wanted distance", **_WANTED))
    return out
