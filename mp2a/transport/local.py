"""All robots in one process: a round is an index."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from mp2a.schedule import Nodes, Round
from mp2a.spatial import Array


class Arrival(NamedTuple):
    """Messages of one kind that came in a round."""

    kind: str
    nodes: Nodes
    """The k receiving nodes."""
    parts: tuple[Array, ...]
    """``(k, T, numbers)`` of each part."""


class LocalTransport:
    """Every node of a schedule in this process, for programs without MPI and for tests of any n.

    Attributes
    ----------
    messages, doubles
        What would have been sent so far.
    """

    def __init__(self) -> None:
        self.messages = 0
        self.doubles = 0

    def exchange(self, round_: Round, outbox: Mapping[str, tuple[Array, ...]]) -> Iterator[Arrival]:
        """Hand the senders' rows to the receivers."""
        for kind, source, target in round_.transfers:
            parts = tuple(part[source] for part in outbox[kind])
            self.messages += len(source)
            self.doubles += sum(part.size for part in parts)
            yield Arrival(kind, target, parts)
