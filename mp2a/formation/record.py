"""A whole march, and what is kept of it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.formation.march import March
from mp2a.formation.sensing import Discs
from mp2a.spatial import Array

_FORMAT = 1


class Record(NamedTuple):
    """What T ticks of a march were, for the m robots of a process or all n; ground frame unless said otherwise."""

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
    """Of the virtual joint at the end of the tick, in the axes of its place, ``(T, m, 3)``, m, m, rad"""
    failed: NDArray[np.bool_]
    """``(T, m)``"""


def run(march: March, ticks: int, world: Discs, say: Callable[[str], None] = lambda what: None) -> Record:
    """March for some ticks through a world; collective where the robots are on ranks.

    Parameters
    ----------
    march
        Where the robots of this process are; each senses the world from its last setpoint.
    ticks
        How many.
    world
        What there is to sense.
    say
        Is told now and then how far the march has come.
    """
    rows: list[tuple[Any, ...]] = []
    for tick in range(ticks):
        time = march.time
        setpoints = march.step(world.sense(march.state.pose))
        report = march.report
        assert report is not None
        rows.append(
            (
                time, setpoints.pose, setpoints.twist, report.scan.motion.velocity, report.push, report.scan.force,
                march.state.displacement.value, setpoints.failed,
            )
        )  # fmt: skip
        if tick % 50 == 0:
            say(f"march: {time:.0f} of {ticks * march.tick:.0f} s")
    return Record(*(np.array(column) for column in zip(*rows, strict=True)))


def together(parts: list[Record]) -> Record:
    """Join the records of all processes, in the order of the robots."""
    columns = list(zip(*parts, strict=True))
    return Record(columns[0][0], *(np.concatenate(column, axis=1) for column in columns[1:]))


def save(path: Path, record: Record, about: dict[str, Any]) -> None:
    """Write a record and what it is about: JSON, or numpy's format for a name that ends in ``.npz``.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".npz":
            about_text = json.dumps({"format": _FORMAT, **about})
            with path.open("wb") as file:
                np.savez_compressed(file, about=np.array(about_text), **record._asdict())
        else:
            arrays = {name: np.asarray(value).tolist() for name, value in record._asdict().items()}
            path.write_text(json.dumps({"format": _FORMAT, "about": about, **arrays}) + "\n")
    except OSError as error:
        raise InputError(f"out: {path} cannot be written ({error.strerror})") from error


def load(path: Path) -> tuple[Record, dict[str, Any]]:
    """Read what `save` wrote.

    Raises
    ------
    InputError
        If the file cannot be read or holds no march.
    """
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as file:
                data = {name: file[name] for name in file.files}
            about = json.loads(str(data.pop("about")))
            version = about.pop("format")
        else:
            data = json.loads(path.read_text())
            about, version = data.pop("about"), data.pop("format")
        if version != _FORMAT:
            raise ValueError(f"format {version}")
        return Record(**{name: np.array(value) for name, value in data.items()}), about
    except Exception as error:  # damaged files raise a dozen kinds
        raise InputError(f"path: {path} cannot be read as a march ({error})") from error
