"""A whole march by dynamics, and what is kept of it."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.array_file import load_arrays, save_arrays
from mp2a.formation.controller import FormationController, Setpoints
from mp2a.spatial import Array

_FORMAT = 2


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


def record_row(time: float, controller: FormationController, setpoints: Setpoints) -> tuple[Any, ...]:
    """Return what is kept of a step that has just been made: a row of a `FormationRecord`."""
    report = controller.report
    assert report is not None
    return (
        time, setpoints.pose, setpoints.twist, report.scan.motion.velocity, report.push, report.scan.force,
        controller.state.displacement.value, setpoints.failed,
    )  # fmt: skip


def join_records(parts: list[FormationRecord]) -> FormationRecord:
    """Join the records of all processes, in the order of the robots."""
    columns = list(zip(*parts, strict=True))
    return FormationRecord(columns[0][0], *(np.concatenate(column, axis=1) for column in columns[1:]))


def save_record(path: Path, record: FormationRecord, about: dict[str, Any]) -> None:
    """Write a record and what it is about as ``.npz``, whole or not at all; raises `OutputError` if it cannot."""
    save_arrays(path, _FORMAT, record._asdict(), about)


def load_record(path: str | Path) -> tuple[FormationRecord, dict[str, Any]]:
    """Read what `save_record` wrote; raises `InputError` if the file cannot be read or holds no march."""
    fields = FormationRecord._fields
    return load_arrays(path, "march", _FORMAT, fields, lambda arrays, about: (FormationRecord(**arrays), about))
