"""The process that writes what robots did; ``python -m mp2a.robots.records.writer``, which `DriveRecorder` starts.

It reads pickled objects from its standard input: `RecordConfig`, then role, stamp and `DriveTick` for each tick. End
of input: the planner has ended, or was killed, which here makes no difference; the files are finished. It runs in a
session of its own and ignores the signals that end the planner, so that these do not end it before the files are whole.
"""

import contextlib
import csv
import os
import pickle
import signal
import sqlite3
import sys
from pathlib import Path
from typing import Any, BinaryIO

from mp2a.dependencies import need
from mp2a.exceptions import InputError, OutputError
from mp2a.robots.child import READY
from mp2a.robots.records.bag_writer import BagWriter, bag_path
from mp2a.robots.records.recorder import NO_BAG, RecordConfig
from mp2a.robots.ticks import COLUMNS, DriveTick, table_row

_YIELD = 10
"""By how much it is nicer than the planner, whose ticks come first."""


class RobotFiles:
    """Table and bag of one robot, begun at its first tick."""

    def __init__(self, config: RecordConfig, role: str) -> None:
        # A row at a time: should this be killed too, the table is there.
        self._table = csv_path(config.folder, role).open("x", buffering=1, newline="")
        self._rows = csv.writer(self._table)
        self._rows.writerow(COLUMNS)
        self._bag: BagWriter | None = None
        if config.bag != NO_BAG:
            path = bag_path(config.folder, role, config.bag)
            self._bag = BagWriter(path, config.bag, role, config.robots[role])
        self._headline = config.headline

    def add(self, stamp: int, tick: DriveTick) -> None:
        """Write a tick."""
        self._rows.writerow(table_row(tick))
        if self._bag is not None:
            if self._headline:
                self._bag.tell(stamp, self._headline)
                self._headline = ""
            self._bag.add(stamp, tick)

    def close(self) -> None:
        """Finish both."""
        self._table.close()
        if self._bag is not None:
            self._bag.close()


def csv_path(folder: Path, role: str) -> Path:
    """Return where the table of a robot is."""
    return folder / f"{role}.csv"


def prepare(config: RecordConfig) -> None:
    """Make the folder, and see that nothing is in the way.

    Raises
    ------
    InputError
        If the folder has a record of a robot.
    OutputError
        If it cannot be made, or written to.
    DependencyError
        If rosbags is not installed.
    """
    if config.bag != NO_BAG:
        need("rosbags.highlevel", extra="record", purpose=f"--record with a bag (without one: --bag {NO_BAG})")
    try:
        config.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"--record: {config.folder} cannot be made a folder ({error.strerror})") from error
    if not os.access(config.folder, os.W_OK | os.X_OK):
        raise OutputError(f"--record: {config.folder} cannot be written to")
    for role in config.robots:
        for path in (csv_path(config.folder, role), *(bag_path(config.folder, role, bag) for bag in ("mcap", "ros1"))):
            if os.path.lexists(path):
                raise InputError(f"--record: {path} is there already, expected a folder without a record of {role}")


def write_records(config: RecordConfig, source: BinaryIO) -> None:
    """Write what comes until the end of input."""
    files: dict[str, RobotFiles] = {}
    # A planner that is killed while it writes leaves a piece of a tick.
    with contextlib.ExitStack() as open_files, contextlib.suppress(EOFError, pickle.UnpicklingError):
        while True:
            role, stamp, tick = pickle.load(source)
            if role not in files:
                files[role] = RobotFiles(config, role)
                open_files.callback(files[role].close)
            files[role].add(stamp, tick)


def main() -> int:
    """Write until the planner ends; returns the exit status."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.nice(_YIELD)
    source: Any = sys.stdin.buffer
    config = pickle.load(source)
    try:
        prepare(config)
        sys.stdout.write(READY)
        sys.stdout.flush()
        write_records(config, source)
    except (OSError, sqlite3.Error) as error:  # a full disk, for instance
        sys.stdout.write(f"OutputError: {_reason(config, error)}\n")
        return 1
    except Exception as error:  # whatever it is, the planner is told in a line, and drives on
        sys.stdout.write(f"{type(error).__name__}: {error}\n")
        return 1
    return 0


def _reason(config: RecordConfig, error: Exception) -> str:
    if isinstance(error, OutputError):
        return str(error)
    where = getattr(error, "filename", None) or config.folder
    return f"{where}: cannot be written ({getattr(error, 'strerror', None) or error})"


if __name__ == "__main__":
    sys.exit(main())
