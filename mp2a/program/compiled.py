"""A recorded program whose rounds are done by compiled calls, with persistent requests.

`mp2a.kernels.replay` does the steps: exchanges, and the operations that have a compiled form. What has none is done
here between them. The compiled loop looks for messages only so often; then Python takes over to wait as
`mp2a.transport.wait` does, finds messages that do not fit, and hands back.
"""

import ctypes
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import kernels
from mp2a.cores import is_oversubscribed
from mp2a.mpi import MPI
from mp2a.program.memory import Frame
from mp2a.program.operations import add
from mp2a.program.recorder import Communication, Computation
from mp2a.program.replay import compute, exchange_only, values_of
from mp2a.spatial import Array
from mp2a.transport.link import Receiving, arrived
from mp2a.transport.mpi import MPITransport
from mp2a.transport.wait import YIELDS, wait

_LOOKS = 4096


class _Wait(NamedTuple):
    """What a step waits for."""

    receiving: list[Receiving]
    sending: list[MPI.Prequest]
    exchanges: int
    """Exchanges begun so far."""


class _Piece(NamedTuple):
    """Compiled steps that follow one another, or one computation that has no compiled form."""

    first: int
    last: int
    computation: Computation | None
    exchanges: int
    """Exchanges begun before it."""


class CompiledProgram:
    """A program bound to memory, requests and a tag.

    Parameters
    ----------
    function
        `mp2a.kernels.rounds`.
    frame
        The program's memory.
    transport
        Over MPI's own messages; it has the tag, and is told what was sent.

    Attributes
    ----------
    steps
        ``(k, 6)`` of steps as `mp2a.kernels.replay` describes them.
    """

    def __init__(self, function: Callable[[int, int, int], int], frame: Frame, transport: MPITransport) -> None:
        self.frame = frame
        self.tag = transport.tag
        self._function, self._transport = function, transport
        self._comm = transport.link.comm
        self._requests: list[MPI.Prequest] = []
        self._alike: dict[tuple[bool, int, int], list[MPI.Prequest]] = {}
        self._in_flight: list[MPI.Prequest] = []
        self._kept: list[object] = []
        self._waits: dict[int, _Wait] = {}
        self._sent: list[list[tuple[str, int]]] = []
        self._pieces: list[_Piece] = []
        self._steps: list[tuple[int, ...]] = []
        self._after: list[str] = []
        self._recurrence = ""
        for instruction in frame.layout.program.instructions:
            if isinstance(instruction, Communication):
                self._communicate(instruction)
            elif instruction.operation.step is not None:
                self._compute(instruction)
            else:
                self._end_piece()
                end = len(self._steps)
                self._pieces.append(_Piece(end, end, instruction, len(self._sent)))
        self._await([])
        self._end_piece()
        self.steps = np.array(self._steps, dtype=np.int64).reshape(-1, 6)
        self._header = self._make_header()
        self._address = _address(self._header)

    def run(self) -> None:
        """Go through the program; once a message comes that does not fit, through the exchanges alone.

        Raises
        ------
        Exception
            What a computation raised, after all exchanges.
        """
        for first, last, computation, exchanges in self._pieces:
            if computation is not None:
                try:
                    compute(self.frame, computation)
                except Exception:
                    self._give_up(exchanges)
                    raise
                continue
            at = self._function(self._address, first, last)
            while at != last:
                if at < 0:
                    raise MPI.Exception(-at)
                if not self._fits(self._waits[at]):
                    self._give_up(self._waits[at].exchanges)
                    return
                at = self._function(self._address, at + 1, last)
        self._count(len(self._sent))

    def arithmetic(self, recurrence: str) -> Callable[[], int]:
        """Return a function that does the compiled arithmetic of a recurrence's rounds alone, to time it."""
        messages = [kernels.STEPS.index(what) for what in ("start", "await")]
        own = [after == recurrence for after in self._after]
        steps = self.steps[own & ~np.isin(self.steps[:, 0], messages)]
        header = self._header.copy()
        header[0] = _address(steps)
        kept = steps, header, self
        return lambda: self._function(_address(kept[1]), 0, len(kept[0]))

    def free(self) -> None:
        """Give the requests back."""
        for request in self._requests:
            request.Free()
        self._requests = []

    def abandon(self) -> None:
        """Withdraw what is still wanted, after a call that was broken off, and give the requests back."""
        for wait_ in self._waits.values():
            for receiving in wait_.receiving:
                if not receiving.request.Test():
                    receiving.request.Cancel()
                    receiving.request.Wait()
        self.free()

    def _fits(self, wait_: _Wait) -> bool:
        """Wait for messages; tells whether all were as they should be."""
        fits = [arrived(self._comm, receiving, None) for receiving in wait_.receiving]
        for request in wait_.sending:
            wait(request)
        return all(fits)

    def _give_up(self, exchanges: int) -> None:
        """Go on with empty messages after some exchanges."""
        for request in self._requests:
            wait(request)
        self._count(exchanges)
        self._transport.valid = False
        exchange_only(self.frame, self._transport, exchanges)

    def _count(self, exchanges: int) -> None:
        for messages in self._sent[:exchanges]:
            for kind, doubles in messages:
                self._transport.count(kind, doubles)

    def _communicate(self, instruction: Communication) -> None:
        self._recurrence = instruction.round.recurrence
        receiving = []
        for message in instruction.receives:
            into = self.frame.message(message)
            request = self._request(self._comm.Recv_init, into, message.partner)
            receiving.append(Receiving(request, into, into, message.partner, self.tag))
        sending, sent = [], []
        for message in instruction.sends:
            data = self.frame.message(message)
            sending.append(self._request(self._comm.Send_init, data, message.partner))
            sent.append((message.kind, data.size))
        self._sent.append(sent)
        if not receiving and not sending:
            return
        self._messages("start", [*(r.request for r in receiving), *sending])
        self._await(receiving)
        self._in_flight = sending

    def _compute(self, instruction: Computation) -> None:
        operation, inputs, outputs = instruction
        assert operation.step is not None
        out = self.frame.values[outputs[0]]
        assert out is not None
        arrays: list[Array] = [out, *values_of(self.frame, inputs)]
        count = out.size if operation is add else self.frame.samples
        self._step(operation.step, count, *(_address(array) for array in arrays))

    def _await(self, receiving: list[Receiving]) -> None:
        if receiving or self._in_flight:
            self._waits[len(self._steps)] = _Wait(receiving, self._in_flight, len(self._sent))
            self._messages("await", [*(r.request for r in receiving), *self._in_flight])

    def _end_piece(self) -> None:
        first = self._pieces[-1].last if self._pieces else 0
        if first < len(self._steps):
            self._pieces.append(_Piece(first, len(self._steps), None, 0))

    def _request(self, make: Callable[..., MPI.Prequest], data: Array, partner: int) -> MPI.Prequest:
        alike = self._alike.setdefault((make == self._comm.Send_init, partner, _address(data)), [])
        for request in alike:
            if not any(request is sent for sent in self._in_flight):
                return request
        alike.append(make([data, MPI.DOUBLE], partner, self.tag))
        self._requests.append(alike[-1])
        return alike[-1]

    def _messages(self, what: str, requests: Sequence[MPI.Request]) -> None:
        # A persistent request keeps its handle, so any number of copies of it may be in use.
        size = MPI._sizeof(MPI.Request)
        handles = b"".join(ctypes.string_at(MPI._addressof(request), size) for request in requests)
        array = np.frombuffer(handles, dtype=np.uint8).copy()
        self._kept.append(array)
        self._step(what, len(requests), _address(array))

    def _step(self, what: str, count: int, *addresses: int) -> None:
        self._after.append(self._recurrence)
        self._steps.append((kernels.STEPS.index(what), count, *addresses, *[0] * (4 - len(addresses))))

    def _make_header(self) -> NDArray[np.int64]:
        most = max((step[1] for step in self._steps if kernels.STEPS[step[0]] == "await"), default=0)
        statuses = np.zeros(most * MPI._sizeof(MPI.Status), dtype=np.uint8)
        self._kept.append(statuses)
        polite = is_oversubscribed()
        looks = YIELDS if polite else _LOOKS
        return np.array([_address(self.steps), *_functions(), _address(statuses), looks, polite], dtype=np.int64)


def _functions() -> tuple[int, int]:
    """Addresses of MPI_Startall and MPI_Testall in the MPI that mpi4py runs on."""
    library = ctypes.CDLL(MPI.__file__)
    startall, testall = (ctypes.cast(library[name], ctypes.c_void_p).value for name in ("MPI_Startall", "MPI_Testall"))
    assert startall and testall
    return startall, testall


def _address(array: NDArray[np.generic]) -> int:
    assert array.flags.c_contiguous
    return array.ctypes.data
