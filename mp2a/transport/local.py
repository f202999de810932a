"""All robots in one process: a round is an index."""

from collections.abc import Mapping

from mp2a.schedule import Nodes, Round
from mp2a.spatial import Array
from mp2a.transport.base import Arrival


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

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Hand the senders' rows to the receivers."""
        arrivals = []
        for kind, source, target in round_.transfers:
            data = outbox[kind][_as_slice(source)]
            self.messages += len(source)
            self.doubles += data.size
            arrivals.append(Arrival(kind, _as_slice(target), data))
        return arrivals

    def flush(self) -> None:
        """Nothing is in flight here."""


def _as_slice(nodes: Nodes) -> slice:
    """Neighbouring nodes as a slice, so that an exchange is a view and copies nothing."""
    first, last = int(nodes[0]), int(nodes[-1])
    if last - first != len(nodes) - 1:
        raise NotImplementedError("a chain's transfers are between neighbouring nodes in ascending order")
    return slice(first, last + 1)
