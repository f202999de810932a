"""What all ranks have to agree on: whether all is well, and what went wrong."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

import numpy as np

from mp2a import exceptions
from mp2a.exceptions import InputError, RankError
from mp2a.mpi import MPI
from mp2a.transport.wait import wait


class Agreement:
    """Tells again and again whether something is true on every rank, by one request that is kept in Open MPI from 5 on.

    MPICH 5.0 has such requests, but ``MPI_Testall`` takes each of them for an error.

    Parameters
    ----------
    comm
        The ranks. Making, asking and closing are collective.

    Attributes
    ----------
    request
        What compiled code may start and wait for in the place of `reached`, if all is well here; None if there is
        none.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = comm
        self._mine, self._every = np.ones(1, dtype=np.int32), np.ones(1, dtype=np.int32)
        self.request: MPI.Prequest | None = None
        vendor, version = MPI.get_vendor()
        if vendor == "Open MPI" and version >= (5, 0):  # which says of itself that it is MPI 3.1
            self.request = comm.Allreduce_init(self._mine, self._every, MPI.MIN)

    def reached(self, mine: bool) -> bool:
        """Tell whether something is true on every rank; collective."""
        if self.request is None:
            return agree(self._comm, mine)
        self._mine[0] = mine
        self.request.Start()
        wait(self.request)
        self._mine[0] = True
        return self.is_reached

    @property
    def is_reached(self) -> bool:
        """What was found the last time."""
        return bool(self._every[0])

    def close(self) -> None:
        """Give the request back."""
        if self.request is not None:
            self.request.Free()


def agree(comm: MPI.Comm, mine: bool) -> bool:
    """Tell whether something is true on every rank; collective."""
    every = np.empty(1, dtype=np.int32)
    wait(comm.Iallreduce(np.array([mine], dtype=np.int32), every, MPI.MIN))
    return bool(every[0])


def raise_on_all(comm: MPI.Comm, error: Exception | None, difference: Callable[[], str] | None = None) -> NoReturn:
    """Raise the error of the lowest rank that has one, in every rank; collective, once all know that there is one.

    Parameters
    ----------
    comm
        The ranks.
    error
        What went wrong here, if it was here.
    difference
        Says, collectively, in what the ranks differ, if none has an error of its own.

    Raises
    ------
    InputError, DependencyError, RankError
        What that rank raised, with its number before the text; or `InputError` for a difference.
    RankError
        For any other exception, with its type.
    """
    reports = comm.allgather(None if error is None else (type(error).__name__, str(error)))
    failed = [(rank, *report) for rank, report in enumerate(reports) if report is not None]
    if not failed:
        raise InputError("" if difference is None else difference())
    rank, kind, text = failed[0]
    own: type[Exception] | None = getattr(exceptions, kind, None)
    if own is not None:
        raise own(f"rank {rank}: {text}") from error
    raise RankError(f"rank {rank}: {kind}{text and ': '}{text}") from error


def raise_together(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise the error of the lowest rank that has one, in every rank; collective.

    Raises
    ------
    Exception
        As `raise_on_all` does.
    """
    if not agree(comm, error is None):
        raise_on_all(comm, error)


@contextmanager
def shared_errors(comm: MPI.Comm) -> Iterator[None]:
    """Raise in every rank what one of them raises in this block, at its end; collective.

    The block itself must not communicate.
    """
    error: Exception | None = None
    try:
        yield
    except Exception as found:
        error = found
    raise_together(comm, error)
