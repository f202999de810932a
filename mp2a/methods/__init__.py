"""Methods of inverse dynamics, one a file: leaf, exchanges, read-off."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from mp2a import schedule
from mp2a.chain import Chain
from mp2a.leaf import State
from mp2a.methods import compact, kogge_stone, sweep
from mp2a.methods.result import InverseDynamics
from mp2a.methods.serial import serial
from mp2a.schedule import Formation, Schedule
from mp2a.segments import affine
from mp2a.spatial import Array
from mp2a.transport.base import Transport


class Work(NamedTuple):
    """Arithmetic of one robot in one round, as measured on one core; it weighs methods against each other."""

    call: float
    """s, whatever the number of samples, of a recorded round"""
    sample: float
    """s a sample"""

    def seconds(self, samples: int) -> float:
        """Time of a round for some samples."""
        return self.call + samples * self.sample


class Method(NamedTuple):
    """A distributed method: who talks to whom, and what each robot does."""

    schedule: Callable[[Formation], Schedule]
    """Schedule for the parents of a formation."""
    doubles: Mapping[str, int]
    """Numbers a sample in each kind of message."""
    work: Work
    """Mean over the rounds."""
    solve: Callable[[Chain, State, Array, Schedule, Transport], InverseDynamics]
    """``(bodies of this process, their state, gravity, schedule, transport)`` to the results of these bodies."""


METHODS = {
    "kogge-stone": Method(schedule.kogge_stone, affine.DOUBLES, Work(0.1e-6, 0.15e-6), kogge_stone.kogge_stone),
    "compact": Method(schedule.compact, compact.DOUBLES, Work(0.1e-6, 0.02e-6), compact.compact),
    "sweep": Method(schedule.sweep, sweep.DOUBLES, Work(0.1e-6, 0.04e-6), sweep.sweep),
}
"""Every distributed method by name. A new one is a file here and a line in this table."""

__all__ = ["METHODS", "InverseDynamics", "Method", "serial"]
