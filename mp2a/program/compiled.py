"""A recorded program done by compiled calls, with persistent requests; where it can be, by one.

`mp2a.kernels.replay` does the steps: it reads the arguments, exchanges, and does the operations that have a compiled
form. What has none is done here between them. The compiled loop looks for messages only so often; then Python takes
over to wait as `mp2a.transport.wait` does, finds messages that do not fit, and hands back.
"""

import ctypes
import math
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import kernels
from mp2a.cores import is_oversubscribed, mpi_yields
from mp2a.kernels.replay_plan import ReplayCall, replay_call
from mp2a.mpi import MPI
from mp2a.program.memory import COPY, Frame
from mp2a.program.operations import add
from mp2a.program.recorder import Communication, Computation, Instruction
from mp2a.program.replay import compute, exchange, exchange_only, values_of
from mp2a.spatial import Array
from mp2a.transport.base import Transport
from mp2a.transport.link import Receiving, arrived
from mp2a.transport.mpi import MPITransport
from mp2a.transport.wait import wait

_LOOKS, _SHARED_LOOKS = 4096, 256
"""How often compiled code looks for messages before Python sees to them: with a core a rank, and where ranks share."""

_MESSAGES = "start", "await"
_AXIS = kernels.AXIS
_DOUBLE = np.dtype(np.float64)


class _Wait(NamedTuple):
    """What a step waits for."""

    receiving: list[Receiving]
    sending: list[MPI.Prequest]
    exchanges: int
    """Exchanges begun so far."""


class _Piece(NamedTuple):
    """Compiled steps that follow one another, or one instruction that is not compiled."""

    first: int
    last: int
    instruction: Instruction | None
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
        It is told what was sent.
    tag
        Of all messages.
    wire
        What carries out rounds one by one; None where they are compiled too, over MPI's own messages.
    agreement
        Request to start and wait for at the end, after which all ranks know whether all is well; it stays the caller's.

    Attributes
    ----------
    agrees
        Whether the agreement has been asked for when the program is done.
    steps
        ``(k, 7)`` of steps as `mp2a.kernels.replay` describes them.
    """

    def __init__(
        self,
        function: Callable[[int, int, int], int],
        frame: Frame,
        transport: MPITransport,
        tag: int,
        wire: Transport | None = None,
        agreement: MPI.Prequest | None = None,
    ) -> None:
        self.frame = frame
        self._tag = tag
        self._function, self._transport, self._wire = function, transport, wire
        self._comm = transport.link.comm
        self._requests: list[MPI.Prequest] = []
        self._alike: dict[tuple[bool, int, int], list[MPI.Prequest]] = {}
        self._in_flight: list[MPI.Prequest] = []
        self._kept: list[object] = []
        self._waits: dict[int, _Wait] = {}
        self._sent: list[list[tuple[str, int]]] = []
        self._pieces: list[_Piece] = []
        self._steps: list[tuple[int, ...]] = []
        self._what: list[str] = []
        arguments = frame.layout.program.arguments
        self._given, self._given_at = _integers(len(arguments))
        # Numbers that are samples themselves always have their axis.
        self._axes = len(arguments[0].shape) if frame.samples == 1 and arguments[0].shape else -1
        self._read_arguments()
        self._begin = len(self._steps)
        for instruction in frame.layout.program.instructions:
            if isinstance(instruction, Communication) and wire is None:
                self._communicate(instruction)
            elif isinstance(instruction, Computation) and instruction.operation.step is not None:
                self._compute(instruction)
            else:
                self._end_piece()
                end = len(self._steps)
                self._pieces.append(_Piece(end, end, instruction, len(self._sent)))
                if isinstance(instruction, Communication):
                    self._sent.append([])  # counted where it is carried out
        self._await([])
        if agreement is not None:
            self._messages("start", [agreement])
            self._in_flight = [agreement]
            self._await([])
        self._end_piece()
        self.agrees = agreement is not None
        self.steps = np.array(self._steps, dtype=np.int64).reshape(-1, 7)
        header = self._make_header()
        self._header, self._address = _integers(len(header))
        self._header[:] = header
        self._first_end, self._is_one_piece = self._pieces[0].last, len(self._pieces) == 1
        numbers = self._first_end, self._begin, self._given_at, len(arguments), self._axes
        self._call, self._at = replay_call(kernels.outside(), self._address, *numbers) or self._plain_call()
        self._tally = transport.tally(chain.from_iterable(self._sent))
        self._views = [frame.placed_views(single=single) for single in (frame.samples == 1, False)]

    def run(self, arguments: Sequence[Any]) -> bool:
        """Go through the program; once a message comes that does not fit, through the exchanges alone.

        Parameters
        ----------
        arguments
            Of a call.

        Returns
        -------
        bool
            False if they are no arrays that can be taken as they are, or numbers of them are not for compiled
            arithmetic; then nothing was sent.

        Raises
        ------
        Exception
            What a computation raised, after all exchanges.
        """
        transport = self._transport
        transport.tag, transport.valid = self._tag, True
        answer = self._call(*arguments)
        if answer and self._is_one_piece:
            self._tally.times += 1
            return True
        if answer is not False:
            self._go_on(self._first_end if answer else self._at(), arguments)
        return answer is not False

    def results(self) -> dict[str, Any]:
        """Return the outputs of the last run for the caller to keep, in the shape of its arguments."""
        axis = self._header[_AXIS]
        views = self._views[axis]
        if views is None:
            return self.frame.results(single=not axis)
        return {name: view.copy() for name, view in views}

    def _plain_call(self) -> ReplayCall:
        """Return what does the work of `mp2a.kernels.replay_plan` by ctypes."""
        at = 0

        def call(*arguments: Any) -> bool | None:
            nonlocal at
            for k, array in enumerate(arguments):
                if type(array) is not np.ndarray:
                    return False
                self._given[k] = id(array)
            self._header[_AXIS] = arguments[0].ndim != self._axes
            at = self._function(self._address, 0, self._first_end)
            return True if at == self._first_end else False if 0 <= at < self._begin else None

        return ReplayCall(call, lambda: at)

    def _go_on(self, at: int, arguments: Sequence[Array]) -> None:
        """Do what is left after the first call of compiled steps."""
        for argument, array in zip(self.frame.layout.program.arguments, arguments, strict=True):
            # What compiled steps have no use for was not copied.
            if argument.number is not None and argument.number not in self.frame.layout.places:
                self.frame.store(argument.number, array.reshape(1, self.frame.samples, -1))
        for k, (first, last, instruction, exchanges) in enumerate(self._pieces):
            try:
                if isinstance(instruction, Computation):
                    compute(self.frame, instruction)
            except Exception:
                self._give_up(exchanges)
                raise
            if isinstance(instruction, Communication):
                assert self._wire is not None
                exchange(self.frame, instruction, self._wire)
                if not self._transport.valid:
                    self._give_up(exchanges + 1)
                    return
            if instruction is None:
                at = at if k == 0 else self._function(self._address, first, last)
                if not self._finish_piece(at, last):
                    return
        if self._wire is not None:
            self._wire.flush()
        self._tally.times += 1

    def _finish_piece(self, at: int, last: int) -> bool:
        """Wait for messages that compiled steps gave up on; tells whether all were as they should be."""
        while at != last:
            if at < 0:
                raise MPI.Exception(-at)
            if not self._fits(self._waits[at]):
                self._give_up(self._waits[at].exchanges)
                return False
            at = self._function(self._address, at + 1, last)
        return True

    def arithmetic(self) -> Callable[[], int]:
        """Return what does all compiled steps but the messages, to time it."""
        return self._arithmetic(range(len(self._what)))

    def stretches(self) -> list[Callable[[], int]]:
        """Return what does so before each exchange and after the last one."""
        at = [k for k, what in enumerate(self._what[:-1]) if what == "await"]
        return [self._arithmetic(range(*bound)) for bound in zip([0, *at], [*at, len(self._what)], strict=True)]

    def _arithmetic(self, steps: Iterable[int]) -> Callable[[], int]:
        chosen = self.steps[[k for k in steps if self._what[k] not in _MESSAGES]]
        header, address = _integers(len(self._header))
        header[:] = self._header
        header[0] = _address(chosen)
        kept = chosen, header, self
        return lambda: self._function(address, 0, len(kept[0]))

    def free(self) -> None:
        """Give the requests back."""
        for request in self._requests:
            request.Free()
        self._requests = []
        self._transport.settle(self._tally)

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
        for kind, doubles in chain.from_iterable(self._sent[:exchanges]):
            self._transport.count(kind, doubles)
        self._transport.valid = False
        exchange_only(self.frame, self._wire or self._transport, exchanges)

    def _read_arguments(self) -> None:
        """Begin with what is given: look at it, and copy what steps have a use for."""
        samples = self.frame.samples
        for k, argument in enumerate(self.frame.layout.program.arguments):
            bound = self._keep(np.array([argument.bound]))
            axes = len(argument.shape)
            form = self._keep(np.array([kernels.number_type(_DOUBLE), axes, samples, *argument.shape]))
            place = None if argument.number is None else self.frame.values[argument.number]
            count = samples * math.prod(argument.shape)
            self._step("read", count, 0 if place is None else _address(place), self._given_at + 8 * k, bound, form)
            if argument.unit is not None and place is not None:
                width, part = place.shape[-1], argument.unit
                self._step("check_length", samples, _address(place), width, part.start, part.stop)

    def _communicate(self, instruction: Communication) -> None:
        receiving = []
        for message in instruction.receives:
            into = self.frame.message(message)
            request = self._request(self._comm.Recv_init, into, message.partner)
            receiving.append(Receiving(request, into, into, message.partner, self._tag))
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
        count = out.size if operation in (add, COPY) else self.frame.samples
        self._step(operation.step, count, *(self._keep(array) for array in arrays))

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
        alike.append(make([data, MPI.DOUBLE], partner, self._tag))
        self._requests.append(alike[-1])
        return alike[-1]

    def _messages(self, what: str, requests: Sequence[MPI.Request]) -> None:
        # A persistent request keeps its handle, so any number of copies of it may be in use.
        size = MPI._sizeof(MPI.Request)
        handles = b"".join(ctypes.string_at(MPI._addressof(request), size) for request in requests)
        self._step(what, len(requests), self._keep(np.frombuffer(handles, dtype=np.uint8).copy()))

    def _step(self, what: str, count: int, *addresses: int) -> None:
        self._what.append(what)
        self._steps.append((kernels.STEPS.index(what), count, *addresses, *[0] * (5 - len(addresses))))

    def _keep(self, array: NDArray[Any]) -> int:
        """Return the address of an array that has to live as long as the steps."""
        self._kept.append(array)
        return _address(array)

    def _make_header(self) -> list[int]:
        most = max((step[1] for step in self._steps if kernels.STEPS[step[0]] == "await"), default=0)
        statuses = self._keep(np.zeros(max(most, 1) * MPI._sizeof(MPI.Status), dtype=np.uint8))
        polite = is_oversubscribed()
        looks = _SHARED_LOOKS if polite else _LOOKS
        return [_address(self.steps), *_functions(), statuses, looks, polite and not mpi_yields(), True]


def _functions() -> tuple[int, int]:
    """Addresses of MPI_Startall and MPI_Testall in the MPI that mpi4py runs on."""
    library = ctypes.CDLL(MPI.__file__)
    startall, testall = (ctypes.cast(library[name], ctypes.c_void_p).value for name in ("MPI_Startall", "MPI_Testall"))
    assert startall and testall
    return startall, testall


def _integers(count: int) -> tuple[Any, int]:
    """Return whole numbers that Python writes faster than those of an array, and their address."""
    numbers = (ctypes.c_int64 * count)()
    return numbers, ctypes.addressof(numbers)


def _address(array: NDArray[np.generic]) -> int:
    assert array.flags.c_contiguous
    return array.ctypes.data
