"""A recorder around another transport: when each round began, what was sent and when it had come."""

import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from mp2a.schedule import Round
from mp2a.spatial import Array
from mp2a.transport.base import Arrival, Nodes, Transport
from mp2a.transport.interpreter import interpret
from mp2a.transport.steps import Layout, Registers, Use


class Event(NamedTuple):
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
        self.nodes = inner.nodes
        self.first = inner.first
        self.events: list[Event] = []

    def registers(self, layout: Layout, samples: int) -> Registers:
        """Get registers of the inner transport."""
        return self.inner.registers(layout, samples)

    def run(self, rounds: Sequence[Round], uses: Mapping[str, Use], registers: Registers) -> None:
        """Go through rounds one exchange after another, so that each can be timed."""
        interpret(rounds, uses, registers, self)

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Exchange by the inner transport."""
        posted = time.monotonic_ns()
        arrivals = self.inner.exchange(round_, outbox)
        self.events.append(Event(round_.recurrence, round_.index, posted, time.monotonic_ns()))
        return arrivals

    def senders(self, round_: Round, kind: str) -> list[Nodes]:
        """Senders of the inner transport."""
        return self.inner.senders(round_, kind)

    def flush(self) -> None:
        """Flush the inner transport."""
        self.inner.flush()
