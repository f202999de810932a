"""Short texts from every robot to every other: what the start is agreed on over."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from mp2a.exceptions import InputError
from mp2a.robots.start import PERIOD, Start

if TYPE_CHECKING:
    from mp2a.mpi import MPI

_TAG = 77
_FAREWELLS = 10
"""Messages to those whose terms are refused."""


class Channel(Protocol):
    """Sends texts to everybody; may lose, delay, repeat or reorder them."""

    def publish(self, text: str) -> None:
        """Send a text to everybody."""

    def receive(self) -> list[str]:
        """Return the texts that have come since the last call; never waits."""

    def announce(self, ready: bool) -> None:
        """Tell this robot's own programs whether all robots are ready."""


class MpiChannel:
    """Texts between the ranks of a communicator, one a robot."""

    def __init__(self, comm: "MPI.Comm") -> None:
        self._comm = comm.Dup()
        self._sent: list[MPI.Request] = []

    def publish(self, text: str) -> None:
        """Send a text to every other rank."""
        self._sent = [request for request in self._sent if not request.Test()]
        others = (rank for rank in range(self._comm.size) if rank != self._comm.rank)
        self._sent += [self._comm.isend(text, rank, _TAG) for rank in others]

    def receive(self) -> list[str]:
        """Return the texts that have come."""
        out = []
        while self._comm.iprobe(tag=_TAG):
            out.append(self._comm.recv(tag=_TAG))
        return out

    def announce(self, ready: bool) -> None:
        """Tell nobody: no other program listens here."""


def agree_on_start(
    start: Start,
    channel: Channel,
    clock: Callable[[], float] = time.time,
    sleep: Callable[[float], None] = time.sleep,
) -> float:
    """Talk until the start is agreed on and near.

    Parameters
    ----------
    start
        This robot's part.
    channel
        To the others.
    clock
        That all robots share, s: that of the machine, kept by NTP.
    sleep
        Waits, s.

    Returns
    -------
    float
        When to start, by that clock.

    Raises
    ------
    InputError
        If another robot drives by other terms. The others are told for another second, so that they refuse as well.
    DependencyError
        If somebody is missing for a minute, a clock is ahead, or it is too late.

    Notes
    -----
    A robot goes on answering and repeating its proposal until the start, since others may have missed it.
    """
    began, announced = clock(), False
    while start.time is None or clock() < start.time - 2 * PERIOD:
        for text in start.say(clock()):
            channel.publish(text)
        if start.all_ready and not announced:
            channel.announce(True)
            announced = True
        sleep(PERIOD)
        try:
            for text in channel.receive():
                for answer in start.hear(text, clock()):
                    channel.publish(answer)
        except InputError:
            for _ in range(_FAREWELLS):
                channel.publish(start.introduction())
                sleep(PERIOD)
            raise
        start.check(clock() - began)
    return start.time
