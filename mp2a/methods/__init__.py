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


class Method(NamedTuple):
    """A distributed method: who talks to whom, and what each robot does."""

    schedule: Callable[[Formation], Schedule]
    """Schedule for the parents of a formation."""
    doubles: Mapping[str, int]
    """Numbers a sample in each kind of message."""
    solve: Callable[[Chain, State, Array, Schedule, Transport], InverseDynamics]
    """``(bodies of this process, their state, gravity, schedule, transport)`` to the results of these bodies."""


METHODS = {
    "kogge-stone": Method(schedule.kogge_stone, affine.DOUBLES, kogge_stone.kogge_stone),
    "compact": Method(schedule.compact, compact.DOUBLES, compact.compact),
    "sweep": Method(schedule.sweep, sweep.DOUBLES, sweep.sweep),
}
"""Every distributed method by name. A new one is a file here and a line in this table."""

__all__ = ["METHODS", "InverseDynamics", "Method", "serial"]
