"""The planner's end of the pipe to the process that writes records."""

import contextlib
import os
import pickle
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.robots.child import start_child, wait_until_ready
from mp2a.robots.robot_config import RobotConfig
from mp2a.robots.ticks import DriveTick

NO_BAG = "none"
_ERRORS = {error.__name__: error for error in (InputError, DependencyError, OutputError)}


class RecordConfig(NamedTuple):
    """What is to be written."""

    folder: Path
    bag: str
    """One of `mp2a.robots.records.bag_writer.BAGS`, or `NO_BAG`: only tables."""
    robots: Mapping[str, RobotConfig]
    """By role."""
    headline: str
    """The first event of each bag, after the robot's name."""


class DriveRecorder:
    """Hands ticks to a process of its own, which writes them; a planner that is killed leaves whole files.

    Parameters
    ----------
    config
        What is to be written; the folder must not hold any of it.
    wait
        Whether `add` may wait for the process: if time is virtual. If not, what the process has not taken yet is
        kept in memory.

    Raises
    ------
    InputError, OutputError, DependencyError
        If there is a record already, nothing can be written there, or rosbags is not installed.
    """

    def __init__(self, config: RecordConfig, *, wait: bool) -> None:
        self._process = start_child("mp2a.robots.records.writer")
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        self._waiting: deque[memoryview] = deque()
        self._gone = False
        self._put(config)
        if said := wait_until_ready(self._process):
            self.close()
            kind, _, why = said.partition(": ")
            if kind in _ERRORS:
                raise _ERRORS[kind](why)
            raise DependencyError(f"--record: no process that writes: {said}")
        os.set_blocking(self._pipe, wait)

    @property
    def pid(self) -> int:
        """The process id of the writer."""
        return self._process.pid

    def add(self, role: str, stamp: int, tick: DriveTick) -> None:
        """Hand a robot's tick over, at ``stamp`` ns of the clock that bags go by; never wait, unless told to."""
        self._put((role, stamp, tick))

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
        kind, _, why = said.partition(": ")
        return (
            why if kind in _ERRORS else said
        ) or f"the process that writes ended with status {self._process.returncode}"

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
