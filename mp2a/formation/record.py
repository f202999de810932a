"""A whole march by dynamics, and what is kept of it."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.files import atomic_write
from mp2a.formation.controller import FormationController, Setpoints
from mp2a.spatial import Array

_FORMAT = 1


class FormationRecord(NamedTuple):
    """What T ticks were, for the m robots of a process or all n; ground frame unless said otherwise."""

    time: Array
    """``(T,)``, s"""
    pose: Array
    """Setpoints, ``(T, m, 3)``, m, m, rad"""
    twist: Array
    """Setpoints: forward speed m/s and turn rate rad/s, ``(T, m, 2)``"""
    velocity: Array
    """From the scan: ahead and to the left m/s, turn rate rad/s, in the robot's frame, ``(T, m, 3)``"""
    push: Array
    """Force of obstacles on the robot, in its frame, ``(T, m, 2)``, N"""
    force: Array
    """Force and torque that the virtual joint passes to the robot, in its frame, ``(T, m, 3)``, N, N, N m"""
    displacement: Array
    """Of the virtual joint at the end of the tick, in the axes of its slot, ``(T, m, 3)``, m, m, rad"""
    failed: NDArray[np.bool_]
    """``(T, m)``"""


def row(time: float, controller: FormationController, setpoints: Setpoints) -> tuple[Any, ...]:
    """Return what is kept of a step that has just been made: a row of a `FormationRecord`."""
    report = controller.report
    assert report is not None
    return (
        time, setpoints.pose, setpoints.twist, report.scan.motion.velocity, report.push, report.scan.force,
        controller.state.displacement.value, setpoints.failed,
    )  # fmt: skip


def join(parts: list[FormationRecord]) -> FormationRecord:
    """Join the records of all processes, in the order of the robots."""
    columns = list(zip(*parts, strict=True))
    return FormationRecord(columns[0][0], *(np.concatenate(column, axis=1) for column in columns[1:]))


def save(path: Path, record: FormationRecord, about: dict[str, Any]) -> None:
    """Write a record and what it is about as ``.npz``, whole or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    text = json.dumps({"format": _FORMAT, **about})
    with atomic_write(path) as new, new.open("wb") as file:
        np.savez_compressed(file, about=np.array(text), **record._asdict())


def load(path: Path) -> tuple[FormationRecord, dict[str, Any]]:
    """Read what `save` wrote.

    Raises
    ------
    InputError
        If the file cannot be read or holds no march.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
        about = json.loads(str(data.pop("about")))
        version = about.pop("format")
        if version != _FORMAT:
            raise ValueError(f"format {version}")
        return FormationRecord(**data), about
    except Exception as error:  # damaged files raise a dozen kinds
        raise InputError(f"path: {path} cannot be read as a march ({error})") from error
