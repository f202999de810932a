"""Threads that share the pieces of a job; compiled kernels run without Python's lock."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from functools import cache
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from mp2a import kernels

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

    from mp2a.kernels.library import Run
    from mp2a.spatial import Array

Result = TypeVar("Result")

_LOOKS = 20_000
"""How often a helper of a crew looks for another job before it sleeps: for some tenths of a millisecond."""


def share(work: Callable[[Iterator[int]], Result], pieces: int, threads: int) -> list[Result]:
    """Have threads, this one among them, work until no piece is left; for pieces of a millisecond or more.

    Parameters
    ----------
    work
        Gets the numbers of the pieces to do, one by one.
    pieces, threads
        How many there are.

    Returns
    -------
    list
        What the work of each thread returned.
    """
    if threads == 1:
        return [work(iter(range(pieces)))]
    left = iter(range(pieces))
    others = [_pool(threads - 1).submit(work, left) for _ in range(threads - 1)]
    return [work(left), *(other.result() for other in others)]


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(workers, thread_name_prefix="mp2a")


class Crew:
    """Helpers for jobs of less than a millisecond, to which handing over from Python would add half (``crew.c``).

    They are started when first needed, look out for jobs for a while after each, and then sleep. The crew serves one
    caller at a time; another one that comes meanwhile works alone.
    """

    def __init__(self) -> None:
        self._fields: NDArray[np.int64] = np.zeros(10, dtype=np.int64)  # struct crew
        self._busy, self._counting = threading.Lock(), threading.Lock()
        self._wake = threading.Semaphore(0)
        self._helpers = self._sleeping = 0

    def run(self, kernel: Run, job: NDArray[np.int64], chunks: int, pieces: int, scratch: Array) -> bool:
        """Run a kernel on all chunks of a job; tells whether no sample is doubtful.

        Parameters
        ----------
        kernel
            As `mp2a.kernels.recursion` describes it.
        job
            What it is to do.
        chunks, pieces
            How many chunks there are, and in how many pieces the threads take them.
        scratch
            Memory for each thread, a row each.
        """
        at, verdict, rows = kernels.pointer, np.zeros(1, dtype=np.int64), list(scratch)
        if len(rows) > 1 and self._busy.acquire(blocking=False):
            try:
                places: NDArray[np.int64] = np.array([at(row) for row in rows], dtype=np.int64)
                numbers = kernels.crew().address(kernel), at(job), at(verdict), places.ctypes.data
                self._fields[3:] = pieces, chunks, len(rows), *numbers
                self._rouse(len(rows) - 1)
                kernels.crew().lead(self._fields.ctypes.data)
            finally:
                self._busy.release()
        else:
            kernel(at(job), 0, chunks, at(rows[0]), at(verdict))
        return not verdict[0]

    def _rouse(self, wanted: int) -> None:
        """Have so many helpers, and all of them awake."""
        while self._helpers < wanted:
            self._helpers += 1
            threading.Thread(target=self._help, args=(self._helpers,), name="mp2a", daemon=True).start()
        with self._counting:
            sleeping, self._sleeping = self._sleeping, 0
        if sleeping:
            self._wake.release(sleeping)

    def _help(self, thread: int) -> None:
        help_, fields = kernels.crew().help, self._fields.ctypes.data
        while True:
            help_(fields, thread, _LOOKS)
            with self._counting:
                self._sleeping += 1
            self._wake.acquire()


CREW = Crew()


def _start_anew() -> None:
    """Forget the threads of the parent process, of which a forked one has none."""
    _pool.cache_clear()
    CREW.__init__()  # type: ignore[misc]


os.register_at_fork(after_in_child=_start_anew)
