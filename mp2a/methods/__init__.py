"""Methods of inverse dynamics, one a file: leaf, exchanges, read-off."""

from collections.abc import Callable
from typing import NamedTuple

from mp2a.chain import Chain
from mp2a.leaf import State
from mp2a.methods.kogge_stone import kogge_stone
from mp2a.methods.result import InverseDynamics
from mp2a.methods.serial import serial
from mp2a.schedule import Schedule
from mp2a.schedule import kogge_stone as kogge_stone_schedule
from mp2a.spatial import Array
from mp2a.transport.base import Transport


class Method(NamedTuple):
    """A distributed method: who talks to whom, and what each robot does."""

    schedule: Callable[[int], Schedule]
    """Schedule for n robots."""
    solve: Callable[[Chain, State, Array, Schedule, Transport], InverseDynamics]
    """``(bodies of this process, their state, gravity, schedule, transport)`` to the results of these bodies."""


METHODS = {"kogge-stone": Method(kogge_stone_schedule, kogge_stone)}
"""Every distributed method by name. A new one is a file here and a line in this table."""

__all__ = ["METHODS", "InverseDynamics", "Method", "serial"]
