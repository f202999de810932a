"""What every transport offers to the drivers."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mp2a.schedule import Round
from mp2a.spatial import Array
from mp2a.transport.steps import Layout, Registers, Use

Nodes = slice | NDArray[np.intp]
"""Some of the nodes of a process: a slice where they are neighbours, so that indexing copies nothing."""


class Arrival(NamedTuple):
    """Messages of one kind that came in a round."""

    kind: str
    nodes: Nodes
    """The k receiving nodes, to index this process's arrays with."""
    data: Array
    """``(k, numbers)``, valid until the next exchange."""


class Transport(Protocol):
    """Carries out rounds of a schedule for the nodes this process holds."""

    nodes: int
    """How many nodes this process holds; arrays of the drivers have this as their first axis."""

    first: int
    """The schedule's number of the first of them."""

    def registers(self, layout: Layout, samples: int) -> Registers:
        """Return registers for a call; those of the call before may be used again."""
        ...

    def run(self, rounds: Sequence[Round], uses: Mapping[str, Use], registers: Registers) -> None:
        """Go through all rounds of a recurrence: exchange, and work out what the uses say.

        The registers must be as they were whenever this recurrence began in calls before, but for their numbers.
        """
        ...

    def senders(self, round_: Round, kind: str) -> list[Nodes]:
        """Nodes of this process that send a kind of message in a round, in groups to index arrays with."""
        ...

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Send what the round says from ``outbox[kind]`` ``(nodes, …)`` and return what came.

        What was sent may be overwritten once the *next* exchange has returned: a robot does not wait here for
        its receiver. What came may be a view of the sender's rows.
        """
        ...

    def flush(self) -> None:
        """Wait until everything sent may be overwritten."""
        ...
