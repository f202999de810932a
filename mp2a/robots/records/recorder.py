"""The planner's end of the pipe to the process that writes records."""

import contextlib
import os
import pickle
import select
import subprocess
import sys
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from mp2a.exceptions import DependencyError, InputError
from mp2a.robots.steps import Step
from mp2a.robots.table import RobotInterface

READY = "ready\n"
"""What the process says once it can write."""
NO_BAG = "none"
_START_PATIENCE = 30.0
"""s for the process to be there."""


class Orders(NamedTuple):
    """What is to be written."""

    folder: Path
    bag: str
    """One of `mp2a.robots.records.bag_writer.BAGS`, or `NO_BAG`: only tables."""
    interfaces: Mapping[str, RobotInterface]
    """By role."""
    headline: str
    """The first event of each bag, after the robot's name."""


class Tick(NamedTuple):
    """A step of a robot."""

    role: str
    stamp: int
    """ns, of the clock that the bag goes by."""
    step: Step


class Recorder:
    """Hands steps to a process of its own, which writes them; a planner that is killed leaves whole files.

    Parameters
    ----------
    orders
        What is to be written; the folder must not hold any of it.
    wait
        Whether `add` may wait for the process: if time is virtual. If not, what the process has not taken yet is
        kept in memory.

    Raises
    ------
    InputError, DependencyError
        If nothing can be written there, or rosbags is not installed.
    """

    def __init__(self, orders: Orders, *, wait: bool) -> None:
        # A session of its own: what ends the planner's group must not end it before the files are whole.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "mp2a.robots.records.writer"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        assert self._process.stdin is not None and self._process.stdout is not None
        self._pipe = self._process.stdin.fileno()
        self._waiting: deque[memoryview] = deque()
        self._gone = False
        self._put(orders)
        output = self._process.stdout
        said = output.readline().decode() if select.select([output], [], [], _START_PATIENCE)[0] else ""
        if said != READY:
            self._process.kill()
            self.close()
            kind, _, why = said.strip().partition(": ")
            raise {"InputError": InputError, "DependencyError": DependencyError}.get(kind, RuntimeError)(
                why or "--record: the process that writes does not start"
            )
        os.set_blocking(self._pipe, wait)

    @property
    def pid(self) -> int:
        """Process id of the writer."""
        return self._process.pid

    def add(self, role: str, stamp: int, step: Step) -> None:
        """Hand a robot's step at ``stamp`` ns over; never waits, unless told to."""
        self._put(Tick(role, stamp, step))

    def close(self) -> str:
        """Hand over what is left, and wait until it is written; returns what went wrong, or an empty text."""
        with contextlib.suppress(OSError):
            os.set_blocking(self._pipe, True)
            self._push()
        with contextlib.suppress(OSError):
            self._process.stdin.close()  # type: ignore[union-attr]
        said, _ = self._process.stdout.read().decode().strip(), self._process.wait()  # type: ignore[union-attr]
        self._process.stdout.close()  # type: ignore[union-attr]
        if not self._process.returncode:
            return ""
        return said or f"the process that writes ended with status {self._process.returncode}"

    def _put(self, what: object) -> None:
        if not self._gone:
            self._waiting.append(memoryview(pickle.dumps(what, pickle.HIGHEST_PROTOCOL)))
            self._push()

    def _push(self) -> None:
        try:
            while self._waiting:
                written = os.write(self._pipe, self._waiting[0])
                self._waiting[0] = self._waiting[0][written:]
                if not self._waiting[0]:
                    self._waiting.popleft()
        except BlockingIOError:
            return
        except OSError:  # it has ended, and says why when this is closed; robots drive on without a record
            self._gone = True
            self._waiting.clear()
