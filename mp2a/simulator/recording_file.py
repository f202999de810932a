"""Recordings as files: ``.npz`` for numpy and the pictures, ``.mcap`` for Foxglove."""

from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from mp2a.exceptions import InputError
from mp2a.files import atomic_write
from mp2a.formation.array_file import load_arrays, save_arrays
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.events import EventKind, RobotEvent
from mp2a.simulator.mcap import to_mcap
from mp2a.simulator.recording import Recording
from mp2a.simulator.world import World

_FORMAT = 4
_PLAIN = ("times", "poses", "twists", "commands", "stamps", "counts", "points", "leaders")
"""Fields of a recording that are arrays, and are in the file as they are."""


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
    if out.suffix == ".npz":
        save_arrays(out, _FORMAT, {name: getattr(recording, name) for name in _PLAIN}, _about(recording))
        return out
    content = to_mcap(recording)
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
    return load_arrays(path, "recording", _FORMAT, _PLAIN, _recording)


def _about(recording: Recording) -> dict[str, Any]:
    """Return all of a recording that is not an array, for JSON."""
    lines = {"leader_paths": recording.leader_paths, "walls": recording.world.walls}
    lines["obstacles"] = recording.world.obstacles
    return {
        "events": [(*event[:3], event.kind.value, event.other) for event in recording.events],
        "roles": recording.roles,
        "models": [astuple(model) for model in recording.models],
        "world": recording.world.name,
        **{name: [line.tolist() for line in many] for name, many in lines.items()},
    }


def _recording(plain: dict[str, Any], about: dict[str, Any]) -> Recording:
    ticks, n = plain["stamps"].shape
    shapes = [plain[name].shape for name in ("times", "poses", "twists", "commands", "counts", "leaders")]
    if shapes != [(ticks,), (ticks, n, 3), (ticks, n, 2), (ticks, n, 2), (ticks, n), (ticks, n, 3)]:
        raise ValueError(f"arrays of {ticks} times and {n} robots have shapes {shapes}")
    if plain["points"].shape != (plain["counts"].sum(), 2):
        raise ValueError(f"{plain['counts'].sum()} points have shape {plain['points'].shape}")
    events = tuple(
        RobotEvent(time, robot, (x, y), EventKind(kind), other) for time, robot, (x, y), kind, other in about["events"]
    )
    roles, models = tuple(about["roles"]), tuple(RobotModel(*fields) for fields in about["models"])
    if not len(models) == len(roles) == n:
        raise ValueError(f"{len(models)} models and {len(roles)} names of {n} robots")
    if any(not 0 <= number < n for event in events for number in (event.robot, event.other or 0)):
        raise ValueError(f"an event of a robot that is none of {n}")
    world = World(about["walls"], about["obstacles"], about["world"])
    paths = tuple(np.array(line).reshape(-1, 2) for line in about["leader_paths"])
    return Recording(**plain, leader_paths=paths, events=events, roles=roles, models=models, world=world)
