"""The process that writes what robots did; ``python -m mp2a.robots.records.writer``, which `Recorder` starts.

It reads pickled objects from its standard input: `Orders`, then a `Tick` for each step. End of input: the planner has
ended, or was killed, which here makes no difference; the files are finished. It runs in a session of its own and
ignores the signals that end the planner, so that these do not end it before the files are whole.
"""

import contextlib
import csv
import os
import pickle
import signal
import sys
from pathlib import Path
from typing import Any, BinaryIO

from mp2a.exceptions import DependencyError, InputError
from mp2a.robots.records.bag_writer import BagWriter, bag_path
from mp2a.robots.records.recorder import NO_BAG, READY, Orders, Tick
from mp2a.robots.steps import COLUMNS, Step, row

_YIELD = 10
"""By how much it is nicer than the planner, whose ticks come first."""


class RobotFiles:
    """Table and bag of one robot, begun at its first step."""

    def __init__(self, orders: Orders, role: str) -> None:
        # A row at a time: should this be killed too, the table is there.
        self._table = csv_path(orders.folder, role).open("x", buffering=1, newline="")
        self._rows = csv.writer(self._table)
        self._rows.writerow(COLUMNS)
        self._bag: BagWriter | None = None
        if orders.bag != NO_BAG:
            path = bag_path(orders.folder, role, orders.bag)
            self._bag = BagWriter(path, orders.bag, role, orders.interfaces[role])
        self._headline = orders.headline

    def add(self, stamp: int, step: Step) -> None:
        """Write a step."""
        self._rows.writerow(row(step))
        if self._bag is not None:
            if self._headline:
                self._bag.tell(stamp, self._headline)
                self._headline = ""
            self._bag.add(stamp, step)

    def close(self) -> None:
        """Finish both."""
        self._table.close()
        if self._bag is not None:
            self._bag.close()


def csv_path(folder: Path, role: str) -> Path:
    """Where the table of a robot is."""
    return folder / f"{role}.csv"


def prepare(orders: Orders) -> None:
    """Make the folder, and see that nothing is in the way.

    Raises
    ------
    InputError
        If the folder cannot be written to, or has a record of a robot.
    DependencyError
        If rosbags is not installed.
    """
    if orders.bag != NO_BAG:
        try:
            import rosbags.highlevel  # noqa: F401
        except ImportError as error:
            why = f"--record: bags need rosbags ({error}); pip install 'mp2a[record]', or --bag {NO_BAG}"
            raise DependencyError(why) from error
    try:
        orders.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--record: {orders.folder} cannot be made a folder ({error})") from error
    if not os.access(orders.folder, os.W_OK | os.X_OK):
        raise InputError(f"--record: {orders.folder} cannot be written to")
    for role in orders.interfaces:
        for path in (csv_path(orders.folder, role), *(bag_path(orders.folder, role, bag) for bag in ("mcap", "ros1"))):
            if path.exists():
                raise InputError(f"--record: {path} is there already, expected a folder without a record of {role}")


def write(orders: Orders, source: BinaryIO) -> None:
    """Write what comes until the end of input."""
    files: dict[str, RobotFiles] = {}
    # A planner that is killed while it writes leaves a piece of a step.
    with contextlib.ExitStack() as open_files, contextlib.suppress(EOFError, pickle.UnpicklingError):
        while True:
            tick: Tick = pickle.load(source)
            if tick.role not in files:
                files[tick.role] = RobotFiles(orders, tick.role)
                open_files.callback(files[tick.role].close)
            files[tick.role].add(tick.stamp, tick.step)


def main() -> int:
    """Write until the planner ends; returns the exit status."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.nice(_YIELD)
    source: Any = sys.stdin.buffer
    orders = pickle.load(source)
    try:
        prepare(orders)
        sys.stdout.write(READY)
        sys.stdout.flush()
        write(orders, source)
    except Exception as error:  # whatever it is, the planner is told in a line, and drives on
        sys.stdout.write(f"{type(error).__name__}: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
