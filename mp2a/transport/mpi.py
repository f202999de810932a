"""Messages between processes: one robot a rank."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from mp2a.mpi import MPI
from mp2a.schedule import Round
from mp2a.transport.base import Parcel
from mp2a.transport.link import Link
from mp2a.transport.wait import wait

_INVALID = 0
_NOTHING = np.empty(0)


class Tally:
    """What is sent again and again, counted by its times."""

    __slots__ = ("doubles", "messages", "times")

    def __init__(self, messages: Iterable[tuple[str, int]]) -> None:
        sent = list(messages)
        self.messages = Counter(kind for kind, _ in sent)
        self.doubles = sum(doubles for _, doubles in sent)
        self.times = 0


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
    """

    def __init__(self, link: Link) -> None:
        self.link = link
        self.valid = True
        self.tag = 1
        self._messages: Counter[str] = Counter()
        self._doubles = 0
        self._tallies: list[Tally] = []
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

    @property
    def messages(self) -> dict[str, int]:
        """What this rank has really sent so far, by kind."""
        self._settle_all()
        return dict(self._messages)

    @property
    def doubles(self) -> int:
        """How many numbers this rank has really sent so far."""
        self._settle_all()
        return self._doubles

    def count(self, kind: str, doubles: int) -> None:
        """Count a message that was sent."""
        self._messages[kind] += 1
        self._doubles += doubles

    def tally(self, messages: Iterable[tuple[str, int]]) -> Tally:
        """Return what counts messages that are sent together, kinds and numbers, until it is settled."""
        self._tallies.append(Tally(messages))
        return self._tallies[-1]

    def settle(self, tally: Tally) -> None:
        """Add up what a tally has counted, and let go of it."""
        self._add(tally)
        if tally in self._tallies:
            self._tallies.remove(tally)

    def abandon(self) -> None:
        """Forget what is in flight, after a call that was broken off."""
        self._in_flight = []

    def _settle_all(self) -> None:
        for tally in self._tallies:
            self._add(tally)

    def _add(self, tally: Tally) -> None:
        for kind, messages in tally.messages.items() if tally.times else ():
            self._messages[kind] += messages * tally.times
        self._doubles += tally.doubles * tally.times
        tally.times = 0

    def _send(self, kind: str, target: int, data: np.ndarray) -> MPI.Request:
        if not self.valid:
            return self.link.send(_NOTHING, target, _INVALID)
        self.count(kind, data.size)
        return self.link.send(data, target, self.tag)
