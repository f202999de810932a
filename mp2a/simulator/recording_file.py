"""Recordings as files: ``.npz`` for numpy and the pictures, ``.mcap`` for Foxglove."""

import io
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from mp2a.exceptions import InputError
from mp2a.file_kinds import kind_of_file
from mp2a.files import atomic_write
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.events import EventKind, RobotEvent
from mp2a.simulator.mcap import to_mcap
from mp2a.simulator.recording import Recording
from mp2a.simulator.world import World
from mp2a.spatial import Array

_FORMAT = 3
_PLAIN = ("times", "poses", "twists", "commands", "stamps", "counts", "points", "leaders")
"""Fields of a recording that are arrays, and are in the file as they are."""
_WALL = -1
"""In the file: no other robot."""


def save_recording(recording: Recording, path: str | Path) -> Path:
    """Write a recording to a file whose ending tells the kind: ``.npz`` for numpy, ``.mcap`` for Foxglove.

    Parameters
    ----------
    recording
        A run.
    path
        Where it goes; its folder is created. An older file is replaced when the new one is whole, not before.

    Returns
    -------
    Path
        The same.

    Raises
    ------
    InputError
        If the ending is another.
    OutputError
        If the file cannot be written.
    DependencyError
        If it is ``.mcap`` and foxglove-sdk is not installed.
    """
    out = Path(path)
    if out.suffix not in (".npz", ".mcap"):
        raise InputError(f"path: got '{out.name}', expected a name that ends in .npz or .mcap")
    content = to_mcap(recording) if out.suffix == ".mcap" else _to_npz(recording)
    with atomic_write(out) as new:
        new.write_bytes(content)
    return out


def load_recording(path: str | Path) -> Recording:
    """Read what `save_recording` wrote as ``.npz``.

    Raises
    ------
    InputError
        If the file cannot be read or is no recording: the message says what it is instead.
    """
    try:
        return _load(path)
    except _NoRecording as error:
        reason = str(error)
    except Exception as error:  # there is no end to what zipfile and numpy raise for a broken file
        # numpy advises to load unsafely what it does not know.
        reason = "a part of it is broken" if "pickle" in str(error) else str(error) or type(error).__name__
    expected = f"expected one of mp2a march (.npz, format {_FORMAT})"
    raise InputError(f"{path}: cannot be read as a recording: {reason}, {expected}")


class _NoRecording(Exception):
    """A file is no recording; says what it is instead."""


def _load(path: str | Path) -> Recording:
    try:
        file = np.load(path, allow_pickle=False)
    except Exception as error:
        raise _NoRecording(f"it is {kind_of_file(path)}") from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise _NoRecording(f"it is {kind_of_file(path)}")
    with file:
        if missing := {"format", *_PLAIN} - set(file.files):
            raise _NoRecording(f"it holds {', '.join(file.files[:4])}, … and no {min(missing)}")
        return _recording(file)


def _to_npz(recording: Recording) -> bytes:
    events, world = recording.events, recording.world
    names, *figures = zip(*map(astuple, recording.models), strict=True)
    file = io.BytesIO()
    arrays = {
        **{name: getattr(recording, name) for name in _PLAIN},
        "event_times": np.array([event.time for event in events], dtype=float),
        "event_robots": np.array([event.robot for event in events], dtype=int),
        "event_places": np.array([event.place for event in events], dtype=float).reshape(-1, 2),
        "event_kinds": np.array([event.kind.value for event in events], dtype=str),
        "event_others": np.array([_WALL if event.other is None else event.other for event in events], dtype=int),
        "roles": np.array(recording.roles, dtype=str),
        "model_names": np.array(names, dtype=str),
        "model_figures": np.array(figures, dtype=float).T,
        "world_name": np.array(world.name),
        **_pack("leader_path", recording.leader_paths),
        **_pack("wall", world.walls),
        **_pack("obstacle", world.obstacles),
    }
    np.savez_compressed(file, allow_pickle=False, format=_FORMAT, **arrays)
    return file.getvalue()


def _recording(file: Any) -> Recording:
    if int(file["format"]) != _FORMAT:
        raise ValueError(f"format {int(file['format'])}, expected {_FORMAT}")
    plain = {name: file[name] for name in _PLAIN}
    ticks, n = plain["stamps"].shape
    shapes = [plain[name].shape for name in ("times", "poses", "twists", "commands", "counts", "leaders")]
    if shapes != [(ticks,), (ticks, n, 3), (ticks, n, 2), (ticks, n, 2), (ticks, n), (ticks, n, 3)]:
        raise ValueError(f"arrays of {ticks} times and {n} robots have shapes {shapes}")
    if plain["points"].shape != (plain["counts"].sum(), 2):
        raise ValueError(f"{plain['counts'].sum()} points have shape {plain['points'].shape}")
    columns = [file[f"event_{name}"].tolist() for name in ("times", "robots", "places", "kinds", "others")]
    events = tuple(
        RobotEvent(time, robot, (x, y), EventKind(kind), None if other == _WALL else other)
        for time, robot, (x, y), kind, other in zip(*columns, strict=True)
    )
    figures = zip(file["model_names"].tolist(), file["model_figures"].tolist(), strict=True)
    models = tuple(RobotModel(name, *row) for name, row in figures)
    roles = tuple(file["roles"].tolist())
    if not len(models) == len(roles) == n:
        raise ValueError(f"{len(models)} models and {len(roles)} names of {n} robots")
    if any(not 0 <= number < n for event in events for number in (event.robot, event.other or 0)):
        raise ValueError(f"an event of a robot that is none of {n}")
    world = World(_unpack("wall", file), _unpack("obstacle", file), str(file["world_name"]))
    paths = tuple(_unpack("leader_path", file))
    return Recording(**plain, leader_paths=paths, events=events, roles=roles, models=models, world=world)


def _pack(name: str, lines: tuple[Array, ...] | Any) -> dict[str, Any]:
    """Put lines ``(k, 2)`` of many lengths into two arrays."""
    sizes = np.array([len(line) for line in lines], dtype=int)
    return {f"{name}_sizes": sizes, f"{name}_corners": np.concatenate([np.empty((0, 2)), *lines])}


def _unpack(name: str, file: Any) -> list[Array]:
    ends = np.cumsum(file[f"{name}_sizes"])
    return np.split(file[f"{name}_corners"], ends)[: len(ends)]
