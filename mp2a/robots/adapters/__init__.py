"""What can be behind a robot, in one table; an adapter is loaded by who drives with it.

A new one is a file with ``make(order)`` and a line in `ADAPTERS`.
"""

import importlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mp2a.formation.choreography.scenario import Scenario
    from mp2a.mpi import MPI
    from mp2a.robots.channel import Channel
    from mp2a.robots.interface import Pace, Robot
    from mp2a.robots.robots_file import RobotsFile
    from mp2a.spatial import Array

EPOCH = 1_000_000_000
"""ns: what records call time 0 where time is virtual. Not 0, which to ROS means no time."""


class Order(NamedTuple):
    """Which robots an adapter is to make."""

    scenario: "Scenario"
    found: "RobotsFile"
    roles: "Sequence[str]"
    """Of this process, at least one."""
    comm: "MPI.Comm | None"
    """With a rank a robot."""
    armed: bool
    places: "Array"
    """``(n, 3)`` where all robots of the scenario start, m and rad."""

    @property
    def period(self) -> float:
        """S a tick."""
        return 1.0 / self.found.interfaces[self.roles[0]].rate


class Made(NamedTuple):
    """What an adapter has made."""

    robots: "Sequence[Robot]"
    """One for each role of this process."""
    pace: "Pace | None" = None
    """Clock; None: time is real, and begins when all robots have agreed."""
    channel: "Callable[[], Channel] | None" = None
    """Opens the way to the other robots where there is no MPI; None: there is nothing to agree on."""
    epochs: "Sequence[int]" = ()
    """ns: what records call time 0, for each robot; empty: as time is real or virtual."""
    report: "Callable[[bool], list[str]]" = lambda good: []
    """Lines to print when all is over, told whether all came to the end."""


class Adapter(NamedTuple):
    """An entry of the table."""

    module: str
    """That has ``make``."""
    real: bool = False
    """Whether time is real, a process drives one robot, and it can be armed."""
    alone: bool = True
    """Whether a robot can be driven without the others."""
    own_frames: bool = False
    """Whether the robots' fixed frames may lie anywhere (``origin``); else they are the ground frame."""

    def make(self, order: Order) -> Made:
        """Make the robots of this process; raises `InputError` or `DependencyError` if one cannot be had."""
        made: Made = importlib.import_module(self.module).make(order)
        return made


ADAPTERS = {
    "dry": Adapter("mp2a.robots.adapters.dry"),
    "simulator": Adapter("mp2a.robots.adapters.simulator", alone=False),
    "recording": Adapter("mp2a.robots.adapters.recording", own_frames=True),
    "ros1": Adapter("mp2a.robots.adapters.ros1", real=True, own_frames=True),
    "ros2": Adapter("mp2a.robots.adapters.ros2", real=True, own_frames=True),
}
REAL = tuple(name for name, adapter in ADAPTERS.items() if adapter.real)
"""Adapters whose time is real."""
