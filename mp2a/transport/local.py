"""All robots in one process: a round is an index."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mp2a.schedule import Round
from mp2a.spatial import Array
from mp2a.transport.base import Arrival, Nodes
from mp2a.transport.interpreter import interpret
from mp2a.transport.steps import Layout, Registers, Use


class LocalTransport:
    """Every node of a schedule in this process, for programs without MPI and for tests of any n.

    Attributes
    ----------
    messages, doubles
        What would have been sent so far.
    """

    first = 0

    def __init__(self, nodes: int) -> None:
        self.nodes = nodes
        self.messages = 0
        self.doubles = 0

    def registers(self, layout: Layout, samples: int) -> Registers:
        """Make new registers."""
        return Registers(layout, self.nodes, samples)

    def run(self, rounds: Sequence[Round], uses: Mapping[str, Use], registers: Registers) -> None:
        """Go through rounds with all nodes at once."""
        interpret(rounds, uses, registers, self)

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Hand the senders' rows to the receivers."""
        arrivals = []
        for kind, source, target in round_.transfers:
            data = outbox[kind][_index(source)]
            self.messages += len(source)
            self.doubles += data.size
            arrivals.append(Arrival(kind, _index(target), data))
        return arrivals

    def senders(self, round_: Round, kind: str) -> list[Nodes]:
        """All that send this kind."""
        return [_index(source) for what, source, _ in round_.transfers if what == kind]

    def flush(self) -> None:
        """Nothing is in flight here."""


def _index(nodes: NDArray[np.intp]) -> Nodes:
    """Neighbouring nodes as a slice, so that an exchange along a chain copies nothing."""
    if len(nodes) and (np.diff(nodes) == 1).all():
        return slice(int(nodes[0]), int(nodes[-1]) + 1)
    return nodes
