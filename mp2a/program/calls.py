"""Collective calls: each rank reads its arguments, then come the rounds; what is wrong on one is raised on all."""

import threading
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar, cast

from mp2a.exceptions import InputError, RankError
from mp2a.mpi import MPI
from mp2a.program.rank import Given, RankProgram
from mp2a.transport.agreement import Agreement, raise_on_all

MANY_SAMPLES = 256
"""Samples from which ranks agree at the end of a call that all went well, as their arithmetic asks for memory that may
not be there; the time that takes is then small beside theirs."""

Call = TypeVar("Call", bound=Callable[..., Any])


Key = tuple[Hashable, ...]
"""Which program a call takes: its name, and whatever else decides."""


class Calls:
    """The calls that the ranks of a communicator make together, in one thread.

    Parameters
    ----------
    comm
        The ranks; it is this object's own.
    program
        Makes the program of a call by its key, when it is first wanted, and what ranks agree by.
    """

    def __init__(self, comm: MPI.Intracomm, program: Callable[..., RankProgram]) -> None:
        self._comm: MPI.Comm = comm
        self._make = program
        self._agreement = Agreement(comm)
        self._programs: dict[Key, RankProgram] = {}
        self._busy, self._thread = threading.Lock(), threading.get_ident()
        self._unusable = ""

    def program(self, key: Key) -> RankProgram:
        """Return the program of a call."""
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = self._make(self._agreement, *key)
        return program

    def run(self, key: Key, arguments: Sequence[Any], read: Callable[..., Given]) -> dict[str, Any]:
        """Make a call; collective.

        Parameters
        ----------
        key
            Of its program; the first part is the call's name.
        arguments
            Of the call.
        read
            Checks them and makes arrays of them; what it raises here is raised on every rank.

        Returns
        -------
        dict of str to array
            The outputs of the program.

        Raises
        ------
        InputError, DependencyError, RankError
            On every rank, for what went wrong on any; on this rank alone, if it is in the middle of another call, or
            the last one was broken off.
        """
        if self._unusable:
            raise RankError(f"{key[0]}: this object cannot be used any more: {self._unusable}")
        if not self._busy.acquire(False):
            raise RankError(f"{key[0]}: another thread is in the middle of a call; only one may use this object")
        try:
            program = self._programs.get(key) or self.program(key)
            error: Exception | None = None
            outputs: dict[str, Any] = {}
            try:
                if threading.get_ident() != self._thread:
                    program.fail()
                    raise RankError(f"{key[0]}: called in another thread than the one that made this object")
                outputs = program.run(arguments, read)
            except MPI.Exception:
                raise
            except Exception as found:
                error = found
            valid = error is None and program.transport.valid
            sure = valid and program.agreement is None and program.samples < MANY_SAMPLES
            if not sure and not self._is_agreed(program, valid):
                raise_on_all(self._comm, error, partial(self._difference, program.samples, program.flag))
            return outputs
        except BaseException as error:
            if isinstance(error, MPI.Exception) or not isinstance(error, Exception):
                self._unusable = f"a call of {key[0]} was broken off ({type(error).__name__}); make a new one"
                for program in self._programs.values():
                    program.abandon()
            raise
        finally:
            self._busy.release()

    def _is_agreed(self, program: RankProgram, valid: bool) -> bool:
        """Tell whether a call went well on every rank; collective."""
        return self._agreement.is_reached if valid and program.has_agreed else self._agreement.reached(valid)

    @contextmanager
    def together(self, call: Call, key: Key) -> Iterator[Call]:
        """Raise on every rank what one of them raises in this block, in which ``call`` is made once."""
        made, name = False, key[0]

        def once(*values: Any, **named: Any) -> Any:
            nonlocal made
            made = True
            return call(*values, **named)

        error: Exception | None = None
        try:
            yield cast("Call", once)
        except Exception as found:
            if made:
                raise
            error = found
        if not made:
            self.run(key, (), _raises(error or InputError(f"together: the block ended without a call of {name}")))

    def close(self) -> None:
        """Free what is kept, and the communicator; collective. Closing twice does nothing."""
        if self._comm == MPI.COMM_NULL:
            return
        for program in self._programs.values():
            program.close()
        if not self._unusable:  # else the others may not come
            self._agreement.close()
            self._comm.Free()
        self._comm, self._unusable = MPI.COMM_NULL, "it is closed"

    def _difference(self, samples: int, flag: bool) -> str:
        """Say in what ranks differ whose messages did not fit; collective."""
        every = self._comm.allgather((samples, flag))
        odd = next((rank for rank, own in enumerate(every) if own != every[0]), 0)
        if every[odd][0] == every[0][0]:
            return f"bodies: got {every[0][1]} on rank 0 and {every[odd][1]} on rank {odd}, expected the same on all"
        return (
            f"samples: got {every[0][0]} samples on rank 0 and {every[odd][0]} on rank {odd}, expected the same number "
            "on every rank"
        )


def _raises(error: Exception) -> Callable[..., Given]:
    def read() -> Given:
        raise error

    return read
