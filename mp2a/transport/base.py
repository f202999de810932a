"""What every transport offers to the drivers."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from mp2a.schedule import Round
from mp2a.spatial import Array


class Arrival(NamedTuple):
    """Messages of one kind that came in a round."""

    kind: str
    nodes: slice
    """The k receiving nodes, as a slice of this process's arrays."""
    data: Array
    """``(k, numbers)``, valid until the next exchange."""


class Transport(Protocol):
    """Carries out rounds of a schedule for the nodes this process holds."""

    nodes: int
    """How many nodes this process holds; arrays of the drivers have this as their first axis."""

    first: int
    """The schedule's number of the first of them."""

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Send what the round says from ``outbox[kind]`` ``(nodes, numbers)`` and return what came.

        What was sent may be overwritten once the *next* exchange has returned: a robot does not wait here for
        its receiver. What came may be a view of the sender's rows.
        """
        ...

    def flush(self) -> None:
        """Wait until everything sent may be overwritten."""
        ...
