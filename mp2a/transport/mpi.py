"""Messages between processes: one robot a rank."""

from collections.abc import Sequence

import numpy as np

from mp2a.mpi import MPI
from mp2a.schedule import Round
from mp2a.transport.base import Parcel
from mp2a.transport.link import Link
from mp2a.transport.wait import wait

_INVALID = 0
_NOTHING = np.empty(0)


class MPITransport:
    """Carries out this rank's messages over a communicator of its own.

    Messages carry a tag that all ranks of a call have in common, made of what has to be the same on all: the number of
    samples. A rank whose input is wrong takes part in all rounds, but with empty messages of tag 0. Either way a
    message that does not fit is never received into a buffer of another size (MPI leaves open what happens then; Open
    MPI has been seen to crash): the receiver finds it by a probe, and from then on sends empty messages itself. By the
    end of a call that sends both ways along the chain each rank knows that something was wrong somewhere, and a call
    where all is well sends nothing more than the schedule says.

    Attributes
    ----------
    valid
        Whether this rank's data are still worth something; `begin` sets it.
    messages, doubles
        What this rank has really sent so far: messages by kind, and numbers in all.
    """

    def __init__(self, link: Link) -> None:
        self.link = link
        self.valid = True
        self.tag = 1
        self.messages: dict[str, int] = {}
        self.doubles = 0
        self._in_flight: list[MPI.Request] = []

    @property
    def largest_tag(self) -> int:
        """Largest tag of this MPI."""
        bound = self.link.comm.Get_attr(MPI.TAG_UB)
        return int(bound) if bound is not None else 32767

    def begin(self, tag: int, *, valid: bool) -> None:
        """Start a call whose messages carry a tag, with valid input or not."""
        self.tag, self.valid = tag, valid

    def exchange(self, round_: Round, sends: Sequence[Parcel], receives: Sequence[Parcel]) -> None:
        """Send and receive a round's messages of this rank; waits for what it receives."""
        coming = [self.link.receive(data, source, self.tag) for _, source, data in receives]
        earlier, self._in_flight = self._in_flight, [self._send(*parcel) for parcel in sends]
        for receiving in coming:
            if not self.link.finish(receiving):
                self.valid = False
        for request in earlier:
            wait(request)

    def flush(self) -> None:
        """Wait until everything sent may be overwritten."""
        for request in self._in_flight:
            wait(request)
        self._in_flight = []

    def count(self, kind: str, doubles: int) -> None:
        """Count a message that was sent."""
        self.messages[kind] = self.messages.get(kind, 0) + 1
        self.doubles += doubles

    def abandon(self) -> None:
        """Forget what is in flight, after a call that was broken off."""
        self._in_flight = []

    def _send(self, kind: str, target: int, data: np.ndarray) -> MPI.Request:
        if not self.valid:
            return self.link.send(_NOTHING, target, _INVALID)
        self.count(kind, data.size)
        return self.link.send(data, target, self.tag)
