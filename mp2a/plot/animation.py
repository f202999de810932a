"""A run of robots as a moving picture."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from PIL import Image

from mp2a import se2
from mp2a.files import atomic_write
from mp2a.plot.looks import INK
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
from mp2a.plot.style import check_picture, legends, styled
from mp2a.simulator.recording import Recording
from mp2a.spatial import Array

_FRAME = 0.1  # s
_LONGEST = 20.0  # s, unless it must be faster than the fastest below
_FASTER = (1, 2, 5, 10, 20, 50, 100)
_DPI = 100
_BLENDS = 64
"""Colours of a GIF beside those of the robots: what is drawn besides, and edges."""
_ALIKE = 8  # of 255, to which a blend would stand for a colour that is there exactly
_SEEN: dict[str, Any] = {"linestyle": "none", "marker": ".", "color": "#e9808f", "zorder": 3}
"""How a point that a LIDAR sees is marked."""


def save_animation(recording: Recording, path: str | Path, *, quiet: bool = False) -> Path:
    """Draw a run as a GIF: the robots, their paths so far, and what their LIDARs see.

    It runs in real time, or a whole factor faster where it would take more than 20 s.

    Parameters
    ----------
    recording
        A run.
    path
        Where it goes; .gif. Its folder is created.
    quiet
        Show no bar on a terminal.

    Returns
    -------
    Path
        The same.

    Raises
    ------
    InputError
        For a recording of fewer than two times, or another ending.
    OutputError
        If the file cannot be written; an older picture is still there then.
    """
    check_recording(recording)
    out = check_picture(path, (".gif",))
    with styled():
        frames = _frames(recording, quiet)
        palette = _palette(next(frames), robot_colors(len(recording.models)))
        flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    with atomic_write(out) as new:
        flat[0].save(new, "GIF", save_all=True, append_images=flat[1:], duration=round(1000 * _FRAME), loop=0)
    return out


def frame_ticks(times: Array) -> tuple[np.ndarray, int]:
    """Choose which ticks become frames, and how many times faster than real time they run.

    Parameters
    ----------
    times
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


def _palette(frame: Image.Image, colors: list[str]) -> Image.Image:
    """Make a palette with exactly the robots' colours, whose small areas a general one would merge, and with others."""
    named = ("white", INK, _SEEN["color"], *colors)
    exact = (255 * np.array([to_rgb(color) for color in named])).round().astype(int)[: 256 - _BLENDS]
    blends = np.array(frame.quantize(_BLENDS).getpalette()).reshape(-1, 3)[:_BLENDS]
    apart = np.abs(blends[:, None] - exact).max(axis=-1).min(axis=-1) > _ALIKE
    out = Image.new("P", (1, 1))
    out.putpalette(np.concatenate((exact, blends[apart])).ravel().tolist())
    return out


def _frames(recording: Recording, quiet: bool) -> Iterator[Image.Image]:
    """Draw what stands still once, and on copies of it what moves; the last picture, which has every colour, first."""
    from rich.console import Console
    from rich.progress import track

    ticks, faster = frame_ticks(recording.times)
    figure, axes = ground(recording)
    figure.set_dpi(_DPI)
    colors = robot_colors(len(recording.models))
    seen = axes.plot([], [], markersize=1.5, **_SEEN)[0]
    paths = LineCollection([], colors=colors, linewidths=1.1, zorder=3)
    bodies = PolyCollection([], facecolors=colors, edgecolors=INK, linewidths=0.7, zorder=5)
    noses = LineCollection([], colors=INK, linewidths=0.7, zorder=6)
    for collection in (paths, bodies, noses):
        axes.add_collection(collection, autolim=False)
    clock = axes.set_title("", loc="right")
    roles = write_roles(axes, recording, -1)
    symbols = {kind: axes.plot([], [], **event_symbol(kind))[0] for kind in event_kinds(recording)}
    moving: list[Any] = [seen, paths, bodies, noses, *roles, *symbols.values(), clock]
    for artist in moving:
        artist.set_animated(True)
    clock.set_text("0000.0 s, 100 ×")  # the layout leaves room for it
    points = [Line2D([], [], markersize=5, label="points that LIDARs see", **_SEEN)] if len(recording.points) else []
    drawn_too = [*leader_handles(recording), *points]
    legends(figure, [("robot", robot_handles(recording)), ("drawn", drawn_too), ("event", event_handles(recording))])
    drawn: Any = figure.canvas
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
        for role, place in zip(roles, recording.poses[k, :, :2], strict=True):
            role.set_position(place)
        for kind, symbol in symbols.items():
            symbol.set_data(*event_places(recording, kind, recording.times[k]).T)
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
            pose = np.array([np.interp(stamp, recording.times, recording.poses[:, i, k]) for k in range(3)])
            clouds.append(se2.act(pose, recording.new_points(int(rows[-1]), i)))
    seen.set_data(*np.concatenate(clouds).T)
