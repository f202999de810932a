"""How the start is agreed on: by MPI, or by short texts from every robot to every other."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from mp2a.exceptions import DependencyError, InputError
from mp2a.robots.start import CLOCK_TOLERANCE, LEAD, PERIOD, Start
from mp2a.transport.wait import wait_unless

if TYPE_CHECKING:
    from mp2a.mpi import MPI

_NAP = 0.01
"""s that a rank sleeps at most between two looks whether all others are ready."""
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


def agree_over_ranks(comm: "MPI.Comm") -> float:
    """Return when to start, once every rank has come here, by the clock that all robots share; collective.

    Raises
    ------
    DependencyError
        If the clocks of two ranks differ.
    """
    wait_unless(comm.Ibarrier(), lambda: False, longest_nap=_NAP)
    times = comm.allgather(time.time())
    apart = max(times) - min(times)
    if apart > CLOCK_TOLERANCE:
        first, last = times.index(max(times)), times.index(min(times))
        raise DependencyError(
            f"the clock of rank {first} is {apart:.1f} s ahead of that of rank {last}; set both by NTP"
        )
    return float(max(times)) + LEAD


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
