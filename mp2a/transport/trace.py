"""A recorder around another transport: when each round began, what was sent and when it had come."""

import time
from collections.abc import Sequence
from typing import NamedTuple

from mp2a.schedule import Round
from mp2a.transport.base import Parcel, Transport


class RoundTiming(NamedTuple):
    """One exchange of one rank; times are this machine's monotonic clock, in ns."""

    recurrence: str
    round: int
    posted: int
    """When the exchange was called: computing ends, sending begins."""
    done: int
    """When everything expected had come."""


class TraceTransport:
    """Passes every exchange on to another transport and notes the time before and after.

    Attributes
    ----------
    events
        What was recorded, in order; clear it with ``events.clear()``.
    """

    def __init__(self, inner: Transport) -> None:
        self.inner = inner
        self.events: list[RoundTiming] = []

    @property
    def valid(self) -> bool:
        """Whether this rank's data are still worth something."""
        return self.inner.valid

    @valid.setter
    def valid(self, valid: bool) -> None:
        self.inner.valid = valid

    def begin(self, tag: int, *, valid: bool) -> None:
        """Start a call of the inner transport."""
        self.inner.begin(tag, valid=valid)

    def exchange(self, round_: Round, sends: Sequence[Parcel], receives: Sequence[Parcel]) -> None:
        """Exchange by the inner transport."""
        posted = time.monotonic_ns()
        self.inner.exchange(round_, sends, receives)
        self.events.append(RoundTiming(round_.recurrence, round_.index, posted, time.monotonic_ns()))

    def flush(self) -> None:
        """Flush the inner transport."""
        self.inner.flush()
