"""Rounds of a method, recorded once and then done by one compiled call, with persistent requests.

What there is to do is what `mp2a.transport.interpreter` does: it is run once with a recorder in the place of the
transport and of the arithmetic. ``mp2a/kernels/rounds.c`` does what was recorded. It looks for messages only so often;
then the interpreter takes over to wait as `mp2a.transport.wait` does, finds messages that do not fit, and hands back.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import kernels
from mp2a.cores import is_oversubscribed
from mp2a.mpi import MPI
from mp2a.schedule import Round
from mp2a.spatial import Array
from mp2a.transport.base import Arrival, Nodes
from mp2a.transport.interpreter import ADD, interpret
from mp2a.transport.link import Receiving, arrived
from mp2a.transport.steps import Registers, Use
from mp2a.transport.wait import YIELDS, wait

_LOOKS = 4096
_OWN = slice(0, 1)

Peers = Mapping[tuple[str, int], Sequence[tuple[str, int]]]
"""Kind and partner of each message of a round, by the round's recurrence and index."""


class Program:
    """Recorded rounds of one recurrence for one rank and a number of samples.

    Attributes
    ----------
    steps
        ``(k, 6)`` of ``struct step`` in ``rounds.c``.
    sent
        Kind and numbers of each message this rank sends, by round.
    misfit
        Whether the last run ended because a message came that does not fit.
    """

    def __init__(self, function: Callable[[int, int, int], int], recorder: "_Recorder", registers: Registers) -> None:
        self.steps = np.array(recorder.steps, dtype=np.int64).reshape(-1, 6)
        self.sent = recorder.sent
        self.misfit = False
        self._function = function
        self._comm, self._requests = recorder.comm, recorder.requests
        self._waits = recorder.waits
        self._version, self._earlier = registers.version.copy(), registers.earlier.copy()
        most = max((int(step[1]) for step in self.steps if kernels.STEPS[step[0]] == "await"), default=0)
        self._statuses = np.zeros(most * MPI._sizeof(MPI.Status), dtype=np.uint8)
        polite = is_oversubscribed()
        startall, testall = _functions()
        looks = YIELDS if polite else _LOOKS
        header = [_address(self.steps), startall, testall, _address(self._statuses), looks, polite]
        self._header = np.array(header, dtype=np.int64)
        self._kept = recorder.kept
        self._call = _address(self._header), len(self.steps)

    def run(self, registers: Registers) -> int:
        """Go through the rounds, all of them unless a message comes that does not fit; returns how many."""
        header, last = self._call
        self.misfit = False
        registers.version, registers.earlier = self._version.copy(), self._earlier.copy()
        at = self._function(header, 0, last)
        while at != last:
            if at < 0:
                raise MPI.Exception(-at)
            wait_ = self._waits[at]
            for receiving in wait_.receiving:
                self.misfit |= not arrived(self._comm, receiving, None)
            for request in wait_.sending:
                wait(request)
            if self.misfit:
                for request in self._requests:
                    wait(request)
                return wait_.rounds
            at = self._function(header, at + 1, last)
        return len(self.sent)

    def without_messages(self) -> Callable[[], int]:
        """Return a function that does the arithmetic alone, to time it."""
        steps = self.steps[[kernels.STEPS[what] not in ("start", "await") for what in self.steps[:, 0]]]
        header = self._header.copy()
        header[0] = _address(steps)
        kept = steps, header, self._kept
        return lambda: self._function(_address(kept[1]), 0, len(kept[0]))

    def free(self) -> None:
        """Give the requests back."""
        for request in self._requests:
            request.Free()
        self._requests = []


class _Wait(NamedTuple):
    """What a step waits for."""

    receiving: list[Receiving]
    sending: list[MPI.Prequest]
    rounds: int
    """Rounds begun so far."""


class _Recorder:
    """Notes down what `interpret` would have done."""

    def __init__(self, comm: MPI.Intracomm, samples: int, sends: Peers, receives: Peers) -> None:
        self.comm = comm
        self.steps: list[tuple[int, ...]] = []
        self.waits: dict[int, _Wait] = {}
        self.sent: list[list[tuple[str, int]]] = []
        self.requests: list[MPI.Prequest] = []
        self.kept: list[object] = []
        self._samples, self._sends, self._receives = samples, sends, receives
        self._inboxes: dict[tuple[int, int], Array] = {}
        self._in_flight: list[MPI.Prequest] = []
        self._requests: dict[tuple[bool, int, int], list[MPI.Prequest]] = {}

    def perform(self, kernel: str, out: Array, nodes: Nodes, inputs: list[Array]) -> None:
        """Record an operation."""
        count = out.size if kernel == ADD else self._samples
        self._step(kernel, count, *(_address(array) for array in (out[nodes], *inputs)))

    def senders(self, round_: Round, kind: str) -> list[Nodes]:
        """Return this rank, if it sends this kind."""
        return [_OWN] if any(what == kind for what, _ in self._sends[round_.recurrence, round_.index]) else []

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Record that messages are sent and received."""
        key = round_.recurrence, round_.index
        arrivals, receiving = [], []
        for place, (kind, source) in enumerate(self._receives[key]):
            into = self._inboxes.setdefault((place, outbox[kind].size), np.empty((1, outbox[kind].size)))
            request = self._request(self.comm.Recv_init, into, source)
            receiving.append(Receiving(request, into, into, source, self._samples))
            arrivals.append(Arrival(kind, _OWN, into))
        sends = self._sends[key]
        sending = [self._request(self.comm.Send_init, outbox[kind], target) for kind, target in sends]
        self.sent.append([(kind, outbox[kind].size) for kind, _ in sends])
        if receiving or sending:
            self._messages("start", [*(r.request for r in receiving), *sending])
            self._await(receiving)
            self._in_flight = sending
        return arrivals

    def finish(self) -> None:
        """Record that all that was sent is waited for."""
        self._await([])

    def _await(self, receiving: list[Receiving]) -> None:
        if receiving or self._in_flight:
            self.waits[len(self.steps)] = _Wait(receiving, self._in_flight, len(self.sent))
            self._messages("await", [*(r.request for r in receiving), *self._in_flight])

    def _request(self, make: Callable[..., MPI.Prequest], data: Array, partner: int) -> MPI.Prequest:
        alike = self._requests.setdefault((make == self.comm.Send_init, partner, _address(data)), [])
        for request in alike:
            if not any(request is sent for sent in self._in_flight):
                return request
        alike.append(make([data, MPI.DOUBLE], partner, self._samples))
        self.requests.append(alike[-1])
        self.kept.append(data)
        return alike[-1]

    def _messages(self, what: str, requests: Sequence[MPI.Request]) -> None:
        # A persistent request keeps its handle, so any number of copies of it may be in use.
        size = MPI._sizeof(MPI.Request)
        handles = b"".join(ctypes.string_at(MPI._addressof(request), size) for request in requests)
        array = np.frombuffer(handles, dtype=np.uint8).copy()
        self.kept.append(array)
        self._step(what, len(requests), _address(array))

    def _step(self, what: str, count: int, *addresses: int) -> None:
        self.steps.append((kernels.STEPS.index(what), count, *addresses, *[0] * (4 - len(addresses))))


def record(
    comm: MPI.Intracomm,
    rounds: Sequence[Round],
    uses: Mapping[str, Use],
    registers: Registers,
    sends: Peers,
    receives: Peers,
) -> Program | None:
    """Record rounds as they begin with the registers as they are; None without compiled kernels."""
    function = kernels.rounds()
    if function is None:
        return None
    before = registers.version.copy(), registers.earlier.copy()
    recorder = _Recorder(comm, registers.samples, sends, receives)
    interpret(rounds, uses, registers, recorder, recorder.perform)
    recorder.finish()
    program = Program(function, recorder, registers)
    registers.version, registers.earlier = before
    return program


def _functions() -> tuple[int, int]:
    """Addresses of MPI_Startall and MPI_Testall in the MPI that mpi4py runs on."""
    library = ctypes.CDLL(MPI.__file__)
    startall, testall = (ctypes.cast(library[name], ctypes.c_void_p).value for name in ("MPI_Startall", "MPI_Testall"))
    assert startall and testall
    return startall, testall


def _address(array: NDArray[np.generic]) -> int:
    assert array.flags.c_contiguous
    return array.ctypes.data
