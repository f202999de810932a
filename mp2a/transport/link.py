"""Point-to-point messages of doubles between ranks: over MPI as they are, or over an emulated network.

A message carries a tag, and a receiver says which tag it expects. What comes with another one does not fit; it is taken
off the line, and the receiver is told, so that a wrong call ends in an error and not in waiting for ever.
"""

import time
from typing import NamedTuple, Protocol

import numpy as np

from mp2a.cores import restore_timer_slack
from mp2a.exceptions import InputError
from mp2a.mpi import MPI
from mp2a.network import EmulatedNetwork
from mp2a.spatial import Array
from mp2a.transport.wait import wait, wait_unless


class Receiving(NamedTuple):
    """A receive that was begun."""

    request: MPI.Request
    into: Array
    """Where the message goes in the end."""
    raw: Array
    """Where MPI puts it."""
    source: int
    tag: int


class Link(Protocol):
    """Messages of one communicator."""

    comm: MPI.Intracomm

    def send(self, data: Array, target: int, tag: int) -> MPI.Request:
        """Begin to send; the data stay as they are until the request is complete."""
        ...

    def receive(self, into: Array, source: int, tag: int) -> Receiving:
        """Begin to receive a message of the size of ``into``, which is contiguous."""
        ...

    def finish(self, receiving: Receiving) -> bool:
        """Wait for a message and put it in its place; False if one came that does not fit."""
        ...


class MPILink:
    """MPI's own messages."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        self.comm = comm

    def send(self, data: Array, target: int, tag: int) -> MPI.Request:
        """See `Link`."""
        return self.comm.Isend([data, MPI.DOUBLE], target, tag)

    def receive(self, into: Array, source: int, tag: int) -> Receiving:
        """See `Link`."""
        return Receiving(self.comm.Irecv([into, MPI.DOUBLE], source, tag), into, into, source, tag)

    def finish(self, receiving: Receiving) -> bool:
        """See `Link`."""
        return arrived(self.comm, receiving, None)


class EmulatedLink:
    """Real messages between the ranks of one machine, each handed over only when a slower network would have it here.

    A message is stamped when it is sent (the ranks of a machine share its clock) and handed over at stamp + latency +
    size / bandwidth; messages do not slow each other down. Waiting ranks sleep. Times over it are called emulated.
    """

    def __init__(self, comm: MPI.Intracomm, network: EmulatedNetwork) -> None:
        self.comm = comm
        self.network = network
        restore_timer_slack()  # what comes early waits asleep, and no longer than it has to

    def send(self, data: Array, target: int, tag: int) -> MPI.Request:
        """See `Link`."""
        stamped = np.empty(data.size + 1) if data.size else np.empty(0)
        if data.size:
            stamped[0] = time.monotonic()
            stamped[1:] = data.reshape(-1)
        return self.comm.Isend([stamped, MPI.DOUBLE], target, tag)

    def receive(self, into: Array, source: int, tag: int) -> Receiving:
        """See `Link`."""
        raw = np.empty(into.size + 1)
        return Receiving(self.comm.Irecv([raw, MPI.DOUBLE], source, tag), into, raw, source, tag)

    def finish(self, receiving: Receiving) -> bool:
        """See `Link`."""
        if not arrived(self.comm, receiving, self.network.latency / 8):
            return False
        raw, into = receiving.raw, receiving.into
        early = float(raw[0]) + self.network.seconds(into.size) - time.monotonic()
        if early > 0:
            time.sleep(early)
        into.reshape(-1)[:] = raw[1:]
        return True


def make_link(comm: MPI.Intracomm, network: EmulatedNetwork | None) -> Link:
    """Link over MPI, or over an emulated network of which the latency and bandwidth are given."""
    if network is None:
        return MPILink(comm)
    if not isinstance(network, EmulatedNetwork):
        raise InputError(f"network: got {type(network).__name__}, expected an mp2a.EmulatedNetwork or None")
    if not (0 <= network.latency < float("inf") and network.bandwidth > 0):
        raise InputError(f"network: got {tuple(network)}, expected a latency in s and a bandwidth in bit/s")
    return EmulatedLink(comm, network)


def measure_latency(link: Link, doubles: int, rounds: int) -> list[float]:
    """One-way seconds of messages between ranks 0 and 1, half of each round trip, on rank 0; nothing elsewhere."""
    rank, times = link.comm.Get_rank(), []
    if rank > 1 or link.comm.Get_size() == 1:
        return []
    data = np.zeros(doubles)
    for _ in range(rounds):
        began = time.perf_counter()
        for sender in (0, 1):
            if sender == rank:
                wait(link.send(data, 1 - rank, 1))
            else:
                link.finish(link.receive(data, 1 - rank, 1))
        times.append((time.perf_counter() - began) / 2)
    return [] if rank else times


def arrived(comm: MPI.Intracomm, receiving: Receiving, longest_nap: float | None) -> bool:
    """Wait for a request; False if a message with another tag came instead, which is taken off the line."""
    request, source = receiving.request, receiving.source
    status = MPI.Status()

    def misfit() -> bool:
        return comm.Iprobe(source, MPI.ANY_TAG, status) and status.Get_tag() != receiving.tag

    if wait_unless(request, misfit, longest_nap):
        return True
    request.Cancel()
    cancelled = MPI.Status()
    request.Wait(cancelled)
    if not cancelled.Is_cancelled():  # it had come after all, and the misfit belongs to a later round
        return True
    comm.Recv([np.empty(status.Get_count(MPI.DOUBLE)), MPI.DOUBLE], source, status.Get_tag())
    return False
