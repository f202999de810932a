"""One rank's part of a method, run again and again: recorded once, bound to memory for a number of samples."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from mp2a import kernels
from mp2a.exceptions import InputError
from mp2a.mpi import MPI
from mp2a.mpi_environment import rank_info
from mp2a.program.compiled import CompiledProgram
from mp2a.program.memory import Frame, lay_out
from mp2a.program.recorder import Program
from mp2a.program.replay import exchange_only, replay
from mp2a.spatial import Array
from mp2a.transport.agreement import Agreement
from mp2a.transport.link import MPILink
from mp2a.transport.mpi import MPITransport
from mp2a.transport.trace import TraceTransport

_KEPT = 1 << 30
"""Bytes of memory that stay from call to call, of a program on all ranks of a machine. With more samples arithmetic
takes far longer than it takes to get memory and to make requests."""


class Given(NamedTuple):
    """Arguments of a call whose shapes were checked."""

    arrays: Sequence[Array]
    """Contiguous, ``(T, *shape)`` each."""
    samples: int
    """T."""
    single: bool
    """Whether results are to be without an axis of samples."""
    check: Callable[[], None]
    """Raises if their numbers are not as they should be."""


class RankProgram:
    """Runs a recorded program over a transport.

    Parameters
    ----------
    name
        Of the call.
    program
        This rank's part of a method.
    transport
        Of the communicator; counts what this rank sends.
    trace
        Around it, where rounds are to be noted, which takes them one by one.
    agreement
        By which ranks agree at the end that all went well; None if what is wrong has reached all by the last round.
    flag
        What has to be the same on every rank, beside the number of samples.

    Attributes
    ----------
    compiled
        The program bound for the number of samples of the last call, if it was kept.
    samples
        Of the last call; 0 if its arguments were wrong.
    has_agreed
        Whether the last call, if it went well here, asked for the agreement as well.
    """

    def __init__(
        self,
        name: str,
        program: Program,
        transport: MPITransport,
        trace: TraceTransport | None = None,
        *,
        agreement: Agreement | None = None,
        flag: bool = False,
    ) -> None:
        self.layout = lay_out(program)
        self.transport, self.flag, self.agreement = transport, flag, agreement
        self.compiled: CompiledProgram | None = None
        self.samples = 0
        self.has_agreed = False
        self._name, self._wire = name, trace or transport
        self._rounds_compiled = trace is None and isinstance(transport.link, MPILink)

    def run(self, arguments: Sequence[Any], read: Callable[..., Given]) -> dict[str, Any]:
        """Run the program; collective.

        Parameters
        ----------
        arguments
            Of the call; such arrays as the program reads are taken as they are. None: only ``read`` has them.
        read
            Makes arrays of any others.

        Returns
        -------
        dict of str to array
            The outputs; worth nothing if the transport is not valid afterwards.

        Raises
        ------
        Exception
            What is wrong with the arguments, or what a computation raised here: after all exchanges.
        """
        compiled = self.compiled
        if compiled is not None and arguments and compiled.run(arguments):
            self.samples, self.has_agreed = compiled.frame.samples, compiled.agrees
            return compiled.results() if self.transport.valid else {}
        return self._run(arguments, read)

    def fail(self) -> None:
        """Take part in a call of the others with nothing to say; collective."""
        self.samples = 0
        self.transport.begin(1, valid=False)
        exchange_only(Frame(self.layout, 1), self._wire)

    def close(self) -> None:
        """Free what is kept for the next call."""
        if self.compiled is not None:
            self.compiled.free()
        self.compiled = None

    def abandon(self) -> None:
        """Withdraw what is in flight, after a call that was broken off."""
        self.transport.abandon()
        if self.compiled is not None:
            self.compiled.abandon()
        self.compiled = None

    def _run(self, arguments: Sequence[Any], read: Callable[..., Given]) -> dict[str, Any]:
        """Run the program with arguments that have to be looked at."""
        with self._else_fail():
            given = read(*arguments)
            compiled = self._bound(given.samples)
        self.samples, self.has_agreed = given.samples, compiled is not None and compiled.agrees
        frame = compiled.frame if compiled is not None and compiled.run(given.arrays) else self._replay(given)
        found = frame.results(single=given.single) if self.transport.valid else {}
        if self.layout.size(given.samples) > _kept():
            self.close()
        return found

    def _replay(self, given: Given) -> Frame:
        """Run the program step by step, with numbers that are not for compiled arithmetic or without kernels."""
        self.has_agreed = False
        with self._else_fail():
            given.check()
            frame = Frame(self.layout, given.samples)
        self.transport.begin(self._tag(given.samples), valid=True)
        frame.give(given.arrays)
        replay(frame, self._wire)
        return frame

    @contextmanager
    def _else_fail(self) -> Iterator[None]:
        """Take part in the call of the others with nothing to say, if something goes wrong before it."""
        try:
            yield
        except MPI.Exception:
            raise
        except Exception:
            self.fail()
            raise

    def _bound(self, samples: int) -> CompiledProgram | None:
        """Bind the program to memory, once for a number of samples; None where there are no compiled kernels."""
        if self.compiled is not None and self.compiled.frame.samples == samples:
            return self.compiled
        self.close()
        function = kernels.rounds()
        tag = self._tag(samples)
        if function is not None:
            wire = None if self._rounds_compiled else self._wire
            request = None if self.agreement is None else self.agreement.request
            frame = Frame(self.layout, samples)
            self.compiled = CompiledProgram(function, frame, self.transport, tag, wire, request)
        return self.compiled

    def _tag(self, samples: int) -> int:
        """Tag of all messages, made of what has to be the same on every rank."""
        tag, largest = 2 * samples + self.flag, self.transport.largest_tag
        if tag > largest:
            raise InputError(
                f"{self._name}: got {samples} samples, expected at most {largest // 2} a call with this MPI"
            )
        return tag


def _kept() -> int:
    info = rank_info()
    return _KEPT // (info.local_size if info else 1)
