"""A march as a moving picture."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from PIL import Image

from mp2a.exceptions import InputError
from mp2a.plot.march import EVENT, FEW, check, ground, outlines, places, robot_colors
from mp2a.plot.style import INK, styled
from mp2a.simulator.recording import Recording
from mp2a.spatial import Array

_FRAME = 0.1  # s
_LONGEST = 20.0  # s, unless it must be faster than the fastest below
_FASTER = (1, 2, 5, 10, 20, 50, 100)
_DPI = 100
_COLORS = 64


def animation(recording: Recording, path: str | Path, *, quiet: bool = False) -> Path:
    """Draw a march as a GIF: the robots, their paths so far, and what their LIDARs see.

    It runs in real time, or a whole factor faster where it would take more than 20 s.

    Parameters
    ----------
    recording : Recording
        A run.
    path : str or Path
        Where it goes; .gif. Its folder is created.
    quiet : bool
        Show no bar on a terminal.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        For a recording of fewer than two times, or another ending.
    """
    out = Path(path)
    if out.suffix.lower() != ".gif":
        raise InputError(f"path: got '{out.name}', expected a name that ends in .gif")
    check(recording)
    with styled():
        frames = _frames(recording, quiet)
        palette = next(frames).quantize(_COLORS)
        flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    out.parent.mkdir(parents=True, exist_ok=True)
    flat[0].save(out, save_all=True, append_images=flat[1:], duration=round(1000 * _FRAME), loop=0)
    return out


def frame_ticks(times: Array) -> tuple[np.ndarray, int]:
    """Choose which ticks become frames, and how many times faster than real time they run.

    Parameters
    ----------
    times : ndarray
        ``(T,)`` s.

    Returns
    -------
    ndarray, int
        Indices, the last of them the last time; and the factor.
    """
    length = times[-1] - times[0]
    faster = next((factor for factor in _FASTER if length / factor <= _LONGEST), _FASTER[-1])
    wanted = np.arange(times[0], times[-1], faster * _FRAME)
    ticks = np.searchsorted(times, wanted - 1e-9)
    return np.append(ticks, len(times) - 1), faster


def _frames(recording: Recording, quiet: bool) -> Iterator[Image.Image]:
    """Draw what stands still once, and on copies of it what moves; the last picture, which has every colour, first."""
    from rich.console import Console
    from rich.progress import track

    ticks, faster = frame_ticks(recording.times)
    figure, axes = ground(recording)
    figure.set_dpi(_DPI)
    colors = robot_colors(len(recording.models))
    seen = axes.plot([], [], linestyle="none", marker=".", markersize=1.5, color="#d4002a", alpha=0.5, zorder=3)[0]
    paths = LineCollection([], colors=colors, linewidths=1.1, zorder=3)
    bodies = PolyCollection([], facecolors=colors, edgecolors=INK, linewidths=0.7, zorder=5)
    noses = LineCollection([], colors=INK, linewidths=0.7, zorder=6)
    for collection in (paths, bodies, noses):
        axes.add_collection(collection, autolim=False)
    clock = axes.set_title("", loc="right")
    numbers = [
        axes.text(0, 0, f"{i + 1}", color=INK, fontsize=8, fontweight="bold", ha="center", va="center", zorder=6)
        for i in range(len(colors))
        if len(colors) <= FEW
    ]
    crosses = axes.plot([], [], **EVENT)[0]
    moving: list[Any] = [seen, paths, bodies, noses, crosses, clock, *numbers]
    for artist in moving:
        artist.set_animated(True)
    drawn: Any = figure.canvas
    clock.set_text("0000.0 s, 100 ×")  # the layout leaves room for it
    drawn.draw()
    still = drawn.copy_from_bbox(figure.bbox)
    console = Console(stderr=True)
    hidden = quiet or not console.is_terminal
    for k in track([ticks[-1], *ticks], "drawing", console=console, disable=hidden, transient=True):
        drawn.restore_region(still)
        paths.set_segments([recording.poses[: k + 1, i, :2] for i in range(len(colors))])
        corners, ahead = outlines(recording, int(k))
        bodies.set_verts(corners)
        noses.set_segments(ahead)
        for number, place in zip(numbers, recording.poses[k, :, :2], strict=False):
            number.set_position(place)
        crosses.set_data(*places([event for event in recording.events if event.time <= recording.times[k]]).T)
        _show_points(seen, recording, int(k))
        clock.set_text(f"{recording.times[k]:.1f} s" + (f", {faster} ×" if faster > 1 else ""))
        for artist in moving:
            figure.draw_artist(artist)
        yield Image.fromarray(np.asarray(drawn.buffer_rgba())[..., :3].copy())


def _show_points(seen: Line2D, recording: Recording, tick: int) -> None:
    """Show the newest scan of each robot, where its points were when it was taken."""
    clouds = [np.empty((0, 2))]
    for i in range(len(recording.models)):
        rows = np.flatnonzero(recording.counts[: tick + 1, i])
        if len(rows):
            stamp = recording.stamps[rows[-1], i]
            x, y, heading = (np.interp(stamp, recording.times, recording.poses[:, i, k]) for k in range(3))
            turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
            clouds.append(recording.new_points(int(rows[-1]), i) @ turn + (x, y))
    seen.set_data(*np.concatenate(clouds).T)
