"""Collective calls: each rank prepares, goes through its rounds, and what is wrong on one is raised on all."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeVar, cast

from mp2a.exceptions import InputError, RankError
from mp2a.mpi import MPI
from mp2a.program.rank import RankProgram
from mp2a.spatial import Array
from mp2a.transport.agreement import agree, raise_on_all

MANY_SAMPLES = 256
"""Samples from which ranks agree at the end of a call that all went well, as their arithmetic asks for memory that may
not be there; the time that takes is then small beside theirs."""

Call = TypeVar("Call", bound=Callable[..., Any])


class Prepared(NamedTuple):
    """Checked input of a call on this rank."""

    inputs: dict[str, Array]
    """Of the program."""
    samples: int
    kept: Any
    """For what comes after the rounds."""


Prepare = Callable[[RankProgram], Prepared]
"""Checks the input of a call and works out what its program needs."""


class Calls:
    """The calls that the ranks of a communicator make together, in one thread.

    Parameters
    ----------
    comm
        The ranks; it is this object's own.
    program
        Makes the program of a call by its name, when it is first wanted.
    """

    def __init__(self, comm: MPI.Intracomm, program: Callable[[str], RankProgram]) -> None:
        self._comm: MPI.Comm = comm
        self._make = program
        self._programs: dict[str, RankProgram] = {}
        self._busy, self._thread = threading.Lock(), threading.get_ident()
        self._unusable = ""

    def program(self, name: str) -> RankProgram:
        """Return the program of a call."""
        if name not in self._programs:
            self._programs[name] = self._make(name)
        return self._programs[name]

    def run(
        self, name: str, prepare: Prepare, *, flag: bool = False, known: bool = False
    ) -> tuple[Any, dict[str, Any]]:
        """Make a call; collective.

        Parameters
        ----------
        name
            Of the call.
        prepare
            What it raises here is raised on every rank.
        flag
            What has to be the same on every rank, beside the number of samples.
        known
            Whether what is wrong has reached all ranks by the last round, so that they need not agree that all is well.

        Returns
        -------
        tuple
            What `prepare` gave to be kept, and the outputs of the program.

        Raises
        ------
        InputError, DependencyError, RankError
            On every rank, for what went wrong on any; on this rank alone, if it is in the middle of another call, or
            the last one was broken off.
        """
        if self._unusable:
            raise RankError(f"{name}: this object cannot be used any more: {self._unusable}")
        if not self._busy.acquire(blocking=False):
            raise RankError(f"{name}: another thread is in the middle of a call; only one may use this object")
        try:
            program = self.program(name)
            return self._run(name, program, prepare, flag, known)
        except BaseException as error:
            if isinstance(error, MPI.Exception) or not isinstance(error, Exception):
                self._unusable = f"a call of {name} was broken off ({type(error).__name__}); make a new one"
                for program in self._programs.values():
                    program.abandon()
            raise
        finally:
            self._busy.release()

    @contextmanager
    def together(self, call: Call, name: str) -> Iterator[Call]:
        """Raise on every rank what one of them raises in this block, in which ``call`` is made once."""
        made = False

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
            self.run(name, _raises(error or InputError(f"together: the block ended without a call of {name}")))

    def close(self) -> None:
        """Free what is kept, and the communicator; collective. Closing twice does nothing."""
        if self._comm == MPI.COMM_NULL:
            return
        for program in self._programs.values():
            program.close()
        if not self._unusable:  # else the others may not come
            self._comm.Free()
        self._comm, self._unusable = MPI.COMM_NULL, "it is closed"

    def _run(
        self, name: str, program: RankProgram, prepare: Prepare, flag: bool, known: bool
    ) -> tuple[Any, dict[str, Any]]:
        error: Exception | None = None
        outputs: dict[str, Any] = {}
        prepared = Prepared({}, 0, None)
        try:
            if threading.get_ident() != self._thread:
                raise RankError(f"{name}: called in another thread than the one that made this object")
            prepared = prepare(program)
            tag, largest = 2 * prepared.samples + flag, program.transport.largest_tag
            if tag > largest:
                raise InputError(
                    f"{name}: got {prepared.samples} samples, expected at most {largest // 2} a call with this MPI"
                )
        except Exception as found:
            error = found
            program.fail()
        else:
            try:
                outputs = program.run(prepared.inputs, prepared.samples, tag)
            except MPI.Exception:
                raise
            except Exception as found:
                error = found
        valid = program.transport.valid
        sure = valid and known and prepared.samples < MANY_SAMPLES
        if not sure and not agree(self._comm, valid):
            raise_on_all(self._comm, error, lambda: self._difference(prepared.samples, flag))
        return prepared.kept, outputs

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


def _raises(error: Exception) -> Prepare:
    def prepare(_: RankProgram) -> Prepared:
        raise error

    return prepare
